#!/usr/bin/env bash
# sbatch this file where examples/paper_models.sh was run; it may be submitted again.
#SBATCH --job-name=paper
#SBATCH --account=ACCOUNT
#SBATCH --partition=PARTITION
#SBATCH --array=0-63
#SBATCH --cpus-per-task=2
#SBATCH --mem=2G
#SBATCH --time=01:00:00
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x_%A_%a.log
nav-sim batch examples/paper_table1.toml --set runs=10000 -o out/paper/table1_10000 -j 2 --time-limit 58m --no-progress
code=$?
# 75: stopped in time, to be resumed
if [ $code -eq 75 ]; then scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}"; fi
exit $code
