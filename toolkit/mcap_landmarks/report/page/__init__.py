"""The HTML page of results: what it shows is gathered from files, written as JSON, and drawn by the page itself."""
