"""A service's package whose migrations a test writes."""

from pathlib import Path

from sqlalchemy import text
from sqlalchemy.exc import DBAPIError

from skyway.runtime.sql.database import Database

REVISION = """
from alembic import op
revision = {revision!r}
down_revision = {before!r}
oldest_code = {oldest_code!r}

def upgrade() -> None:
{statements}
"""


class Package:
    """A service's package whose migrations a test writes."""

    def __init__(self, folder: Path, name: str) -> None:
        self.name = name
        self._versions = folder / name / "migrations" / "versions"
        self._versions.mkdir(parents=True)
        (folder / name / "__init__.py").touch()
        (folder / name / "migrations" / "__init__.py").touch()

    def revise(
        self,
        revision: str,
        *statements: str,
        before: str | None = None,
        oldest_code: str | None = None,
    ) -> None:
        lines = "\n".join(f"    op.execute({statement!r})" for statement in statements)
        script = REVISION.format(
            revision=revision, before=before, statements=lines, oldest_code=oldest_code
        )
        (self._versions / f"{revision}.py").write_text(script)

    def forget(self, revision: str) -> None:
        (self._versions / f"{revision}.py").unlink()


async def has_table(url: str, table: str) -> bool:
    async with Database(url) as db, db.read() as connection:
        try:
            await connection.execute(text(f"SELECT 1 FROM {table}"))
        except DBAPIError:
            return False
    return True
