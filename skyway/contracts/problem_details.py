"""The body of every error answer: RFC 9457 problem details."""

from typing import Annotated

from pydantic import ConfigDict, Field

from skyway.json_model import JsonModel

#: The media type of a problem document (RFC 9457, section 3).
PROBLEM_MEDIA_TYPE = "application/problem+json"


class FieldProblem(JsonModel):
    """One field at fault; `field` is its path in the caller's own JSON: ``packages.0.mass_kg``."""

    model_config = ConfigDict(extra="ignore")

    field: Annotated[
        str,
        Field(
            description="The path of the field in the caller's JSON, such as packages.0.mass_kg."
        ),
    ]
    detail: Annotated[str, Field(description="What is wrong with it.")]


class ProblemDetails(JsonModel):
    """What went wrong; `type` is stable, `code` says more within it, other members may be added."""

    model_config = ConfigDict(
        extra="allow",
        json_schema_extra={
            "examples": [
                {
                    "type": "urn:skyway:problem:invalid-input",
                    "title": "The request breaks a limit",
                    "status": 422,
                    "detail": "packages.0.mass_kg: Input should be greater than or equal to 0",
                    "errors": [
                        {
                            "field": "packages.0.mass_kg",
                            "detail": "Input should be greater than or equal to 0",
                        }
                    ],
                    "trace_id": "4bf92f3577b34da6a3ce929d0e0e4736",
                }
            ]
        },
    )

    type: Annotated[str, Field(description="urn:skyway:problem:<name>, stable")] = "about:blank"
    title: Annotated[str, Field(description="What the type means.")]
    status: Annotated[int, Field(ge=100, le=599, description="The HTTP status, 100 to 599.")]
    detail: Annotated[str | None, Field(description="What went wrong this time.")] = None
    code: Annotated[str | None, Field(description="UPPER_SNAKE, stable within the type")] = None
    errors: Annotated[tuple[FieldProblem, ...], Field(description="each field at fault")] = ()
    trace_id: Annotated[str | None, Field(description="finds the request in our logs")] = None
