"""Road networks that users upload: checked in a process of their own, kept as files, never believed."""
