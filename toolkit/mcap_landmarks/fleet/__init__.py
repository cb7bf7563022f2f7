"""Many logs: tasks, and the workers that run them, each log apart from the others."""
