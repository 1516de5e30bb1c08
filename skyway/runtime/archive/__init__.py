"""The archive: past rows of a service as Parquet files for analysts, a file for each table and day.

`archived_table` says which rows of a table belong to which day, and which columns are left out.
`parquet_file` writes one file. `export` writes all days that are over and have no file yet.
"""
