"""Reports: plots of maps and runs."""
