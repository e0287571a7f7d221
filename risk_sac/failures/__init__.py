"""What is done with a failure once it is found."""
