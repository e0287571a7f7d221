"""Files of a run's folder, written so that no crash spoils them."""
