"""The catalogue of runs: one row per log and run of a batch, in a Parquet file or an SQLite database."""
