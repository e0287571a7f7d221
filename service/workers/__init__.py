"""The worker of a run: how it is started, what it says, how it takes a run's folder over."""
