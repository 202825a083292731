#!/usr/bin/env bash
# sbatch this file after `{{plan}}`; then `{{merge}}`.
#SBATCH --job-name={{name}}
#SBATCH --array=0-{{last}}
#SBATCH --cpus-per-task={{cpus}}
#SBATCH --time={{clock}}
#SBATCH --requeue
#SBATCH --open-mode=append
#SBATCH --output=%x_%a.log
{{task}}
code=$?
# 75: stopped in time, to be resumed
if [ $code -eq 75 ]; then scontrol requeue "${SLURM_ARRAY_JOB_ID}_${SLURM_ARRAY_TASK_ID}"; fi
exit $code
