"""Pictures of cameras beside a run's rows, by a process of their own."""
