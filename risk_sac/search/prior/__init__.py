"""What is shipped trained: script models, script libraries, and what proposes points from them."""
