"""Enrolment: the broker accounts, enrolment tokens and keys.

`credential_store` is their SQL. `password_file` keeps the broker's file equal to the accounts in
the database.
"""
