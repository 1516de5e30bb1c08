"""The SQLAlchemy metadata that all tables of composition share."""

from sqlalchemy import MetaData

metadata = MetaData()
