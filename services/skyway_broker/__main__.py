"""`python -m skyway_broker`: the embedded broker, until its parent ends or a signal stops it."""

import asyncio
import logging
import sys

from skyway.contracts.broker_rules import BrokerRules
from skyway.runtime.errors import exit_code_after
from skyway.runtime.loading import keep_what_is_loaded
from skyway.runtime.loops import stop_signals
from skyway.runtime.tracing import configure_logs
from skyway_broker.gate import Gate
from skyway_broker.hardened import HardenedBroker
from skyway_broker.settings import BrokerSettings

log = logging.getLogger(__name__)


async def serve(settings: BrokerSettings) -> None:
    """Serve until a signal says stop, or until the pipe to the parent closes."""
    loop = asyncio.get_running_loop()
    stopping = asyncio.Event()
    if settings.parent_fd is not None:
        # The parent never writes into the pipe: readable means that the parent closed it.
        loop.add_reader(settings.parent_fd, stopping.set)
    listener = settings.listener()
    gate = Gate(settings.password_file)
    broker = HardenedBroker(listener, gate=gate, rules=BrokerRules(), limits=settings.limits())
    with stop_signals(lambda _reason: stopping.set()):
        await broker.start()
        log.info("broker listens", extra={"port": listener.getsockname()[1]})
        await stopping.wait()
        if settings.parent_fd is not None:
            loop.remove_reader(settings.parent_fd)
        await broker.shutdown()
    log.info("broker stopped")


def main() -> None:
    """Run the broker."""
    settings = BrokerSettings.load()
    configure_logs("broker", settings.log_level)
    # amqtt logs every connection; this package logs the important events itself.
    for library in ("amqtt", "transitions"):
        logging.getLogger(library).setLevel(logging.WARNING)
    keep_what_is_loaded()
    asyncio.run(serve(settings))


if __name__ == "__main__":
    sys.exit(exit_code_after("skyway_broker", main))
