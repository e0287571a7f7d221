"""What answers are made of: problems, pages, media types and tags."""
