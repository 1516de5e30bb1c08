"""Makes the AsyncAPI 3.0 document and the JSON Schema of each message from the list of topics."""

from collections.abc import Iterable, Iterator
from typing import Annotated, Any, Final, get_args, get_origin

from pydantic import BaseModel
from pydantic.json_schema import models_json_schema

from skyway.contracts.delivery_event_forms import AnyDeliveryEvent
from skyway.contracts.message_examples import message_examples
from skyway.contracts.topics import DELIVERY_EVENTS, Topic

#: A JSON document, whose members have no common static type.
Document = dict[str, Any]

_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"
_COMPONENT: Final = "#/components/schemas/{model}"

_PARAMETERS: Final = {
    "p": "provider id; readers trust only {d}, and drop a provider that is not the drone's",
    "d": "drone id: the drone's user name and client id",
    "c": "customer id: the customer's user name",
    "delivery_id": "delivery id",
    "s": "station id",
    "n": "network id",
}


def asyncapi_document(topics: Iterable[Topic[Any]], *, version: str) -> Document:
    """The document from the cloud's point of view: it sends to drones, and receives from drones."""
    topics = tuple(topics)
    messages = _messages_of(topics)
    return {
        "asyncapi": "3.0.0",
        "info": {
            "title": "Skyway over MQTT",
            "version": version,
            "description": "The messages between the cloud, drones and customers. Readers ignore "
            "fields that they do not know, and expect repeated, reordered and missing messages. "
            "What drones write and what they may read has one more member, the last one: "
            "`signature`, Ed25519 over topic and payload (docs/reference/drone-protocol.md).",
        },
        "defaultContentType": "application/json",
        "servers": {"broker": _server()},
        "channels": {channel_name(topic): _channel(topic) for topic in topics},
        "operations": {
            f"{_action(topic)}-{channel_name(topic)}": _operation(topic) for topic in topics
        },
        "components": {
            "messages": {model.__name__: _message(model) for model in messages},
            "schemas": _schemas_of(messages, _COMPONENT),
            "securitySchemes": {
                "account": {"type": "userPassword", "description": "A broker account."}
            },
        },
    }


def message_schemas(topics: Iterable[Topic[Any]]) -> dict[str, Document]:
    """Each message's own JSON Schema (2020-12), complete in itself, by the message's name."""
    examples = message_examples()
    return {
        model.__name__: {
            "$schema": _DIALECT,
            "$id": f"urn:skyway:message:{model.__name__}",
            **model.model_json_schema(mode="serialization"),
            "examples": [_json_of(examples[model.__name__])],
        }
        for model in _messages_of(topics)
    }


def channel_name(topic: Topic[Any]) -> str:
    """The topic's words without its placeholders: ``stations-state``."""
    words = topic.template.split("/")[2:]
    return "-".join(word for word in words if not word.startswith("{"))


def documented_message(topic: Topic[Any]) -> Any:  # a model, or an annotated union of models
    """The message type that documents show: for delivery events one form for each type."""
    return AnyDeliveryEvent if topic is DELIVERY_EVENTS else topic.message


def _messages_of(topics: Iterable[Topic[Any]]) -> list[type[BaseModel]]:
    return list(dict.fromkeys(model for topic in topics for model in _models_of(topic)))


def _models_of(topic: Topic[Any]) -> Iterator[type[BaseModel]]:
    message = documented_message(topic)
    if get_origin(message) is Annotated:
        yield from get_args(get_args(message)[0])
    else:
        yield message


def _server() -> Document:
    return {
        "host": "{host}:{port}",
        "protocol": "mqtt",
        "protocolVersion": "3.1.1",
        "description": "The deployment's broker; it lets in only known accounts.",
        "variables": {"host": {"default": "127.0.0.1"}, "port": {"default": "1883"}},
        "security": [{"$ref": "#/components/securitySchemes/account"}],
    }


def _channel(topic: Topic[Any]) -> Document:
    names = [level[1:-1] for level in topic.template.split("/") if level.startswith("{")]
    channel: Document = {
        "address": topic.template,
        "description": topic.about,
        "messages": {
            model.__name__: {"$ref": f"#/components/messages/{model.__name__}"}
            for model in _models_of(topic)
        },
    }
    if names:
        channel["parameters"] = {name: {"description": _PARAMETERS[name]} for name in names}
    return channel


def _operation(topic: Topic[Any]) -> Document:
    channel = channel_name(topic)
    readers = ", ".join(_account(role, topic) for role in topic.readers)
    return {
        "action": _action(topic),
        "channel": {"$ref": f"#/channels/{channel}"},
        "summary": topic.about,
        "description": f"The broker lets write: {_account(topic.writer, topic)}. "
        f"It lets read: {readers}.",
        "messages": [
            {"$ref": f"#/channels/{channel}/messages/{model.__name__}"}
            for model in _models_of(topic)
        ],
        "bindings": {
            "mqtt": {"qos": topic.mqtt_qos, "retain": topic.retained, "bindingVersion": "0.2.0"}
        },
    }


def _action(topic: Topic[Any]) -> str:
    return "receive" if topic.writer == "drone" else "send"


def _account(role: str, topic: Topic[Any]) -> str:
    own = {"drone": "{d}", "customer": "{c}"}.get(role)
    if own is None:
        return role
    return f"the {role} whose user name is {own}" if own in topic.template else f"every {role}"


def _message(model: type[BaseModel]) -> Document:
    example = message_examples()[model.__name__]
    return {
        "name": model.__name__,
        "contentType": "application/json",
        "payload": {"$ref": _COMPONENT.format(model=model.__name__)},
        "examples": [{"payload": _json_of(example)}],
    }


def _schemas_of(models: list[type[BaseModel]], reference: str) -> Document:
    _, defined = models_json_schema(
        [(model, "serialization") for model in models], ref_template=reference
    )
    return {name: _with_names(schema) for name, schema in sorted(defined["$defs"].items())}


def _with_names(value: Any) -> Any:
    """The JSON value with each discriminator by its name alone, as AsyncAPI has it. Any: JSON."""
    if isinstance(value, list):
        return [_with_names(each) for each in value]
    if not isinstance(value, dict):
        return value
    named = {name: _with_names(each) for name, each in value.items()}
    if isinstance(named.get("discriminator"), dict):
        named["discriminator"] = named["discriminator"]["propertyName"]
    return named


def _json_of(example: BaseModel) -> Document:
    return example.model_dump(mode="json")
