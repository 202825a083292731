#!/usr/bin/env bash
# sbatch this file after `nav-sim batch plan examples/paper_table1_10000.toml --out out/paper_table1_10000`; then `nav-sim batch merge examples/paper_table1_10000.toml --out out/paper_table1_10000`.
#SBATCH --job-name=paper-table1-10000
#SBATCH --array=0-63
#SBATCH --cpus-per-task=2
#SBATCH --time=01:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x_%a.log
nav-sim batch run examples/paper_table1_10000.toml --out out/paper_table1_10000 --shards 64 -j 2 --time-limit 3480s --no-progress
code=$?
# 75: stopped in time, to be resumed
if [ $code -eq 75 ]; then scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}"; fi
exit $code
