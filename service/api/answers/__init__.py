"""Parts of answers: problems, pages, media types and tags."""
