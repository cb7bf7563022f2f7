"""What a log holds, which roles its topics play, and what will go wrong with it."""
