"""RISK-SAC as a service: campaigns over REST, executed in worker processes."""
