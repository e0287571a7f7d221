"""Third-party planners behind the seam; packages come with the extra `planners`."""
