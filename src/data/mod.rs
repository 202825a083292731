//! Files: recordings, models, trajectories. The only library module that reads files.
