"""What gathers all tables of composition, for migrations."""

from sqlalchemy import MetaData

metadata = MetaData()
