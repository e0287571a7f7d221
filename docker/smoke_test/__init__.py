"""What `docker/smoke` runs."""
