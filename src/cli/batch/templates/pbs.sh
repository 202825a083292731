#!/usr/bin/env bash
# qsub this file after `{{plan}}`; then `{{merge}}`.
#PBS -N {{short_name}}
{{array}}#PBS -l select=1:ncpus={{cpus}}
#PBS -l walltime={{clock}}
#PBS -r y
cd "$PBS_O_WORKDIR" || exit 1
{{index}}{{task}}
# exit code 75: stopped in time; qsub the file again to go on
