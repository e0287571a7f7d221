"""Training, benchmarks and measured figures; the product never imports it."""
