"""What is noted of requests, and the metrics of the service."""
