"""The training loop: steps, schedules, averages, evaluation, and what ends a run."""
