"""The collection of all tables of the gateway, for migrations."""

from sqlalchemy import MetaData

metadata = MetaData()
