"""A fake cloud: sends missions, follows them, and answers failures with new plans from there."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from skyway.contracts.drone_report import Ack, DroneEvent, DroneState
from skyway.contracts.flight_step import (
    FlightStep,
    FlyStep,
    PackageOnBoard,
    PickUpStep,
    RechargeStep,
    WaitStep,
)
from skyway.contracts.instruction import AnyInstruction
from skyway.contracts.topics import ACKS, EVENTS, STATE, Topic
from tests.drone_agent.simulation.rehearsal.findings import Findings
from tests.drone_agent.simulation.rehearsal.link import Air
from tests.drone_agent.simulation.rehearsal.mailbox import Mailbox
from tests.drone_agent.simulation.rehearsal.places import HOME
from tests.drone_agent.simulation.rehearsal.plan import (
    NoWay,
    Parcel,
    Plan,
    Standing,
    standing_after,
)

#: After so many plans in a row that came to nothing the mission is given up.
_MOST_PLANS = 14

#: Wall seconds between two looks at what is to be done.
_LOOK_EVERY_S = 1.0

#: Wall seconds between two repetitions of the fleet clock.
_CLOCK_EVERY_S = 30.0


class FakeCloud:
    """A very simple composition service for one drone."""

    def __init__(self, air: Air, findings: Findings, parcels: Sequence[Parcel]) -> None:
        self.mail = Mailbox(air, findings)
        self._air = air
        self._clock = air.clock
        self._parcels = {one.package_id: one for one in parcels}
        self._asked_at = -1e9
        air.listener = self._receive
        self.state: DroneState | None = None
        self.is_over = self.is_down = False
        self.story: list[str] = []
        #: Custody according to events: "pickup", "drone", "DELIVER" or "RETURN".
        self.places = {one.package_id: "pickup" for one in parcels}
        self._unsure: set[str] = set()
        self._received: dict[int, DroneEvent] = {}
        self.steps: list[FlightStep] = []
        self._revision = self._accepted_revision = 0
        self._is_asked = self._is_cancelled = self._is_loading = False
        self._failed: DroneEvent | None = None
        self._standing = Standing(HOME, 1.0)
        self._factor = 1.0
        self._plans_in_vain = 0
        self._next_step = 1

    # What comes

    def _receive(self, topic: Topic[Any], message: Any) -> None:
        if self.mail.is_silent:
            return
        if topic.template == ACKS.template:
            self.mail.receive(message)
        elif topic.template == EVENTS.template:
            self._received.setdefault(message.seq, message)
        elif topic.template == STATE.template:
            is_newer = self.state is None or (message.session, message.seq) > (
                self.state.session,
                self.state.seq,
            )
            if is_newer:
                self.state = message
        self._follow()

    def _follow(self) -> None:
        """Take the events in their order."""
        while (event := self._received.get(self.mail.events_through + 1)) is not None:
            self.mail.events_through += 1
            self._handle(event)

    def _handle(self, event: DroneEvent) -> None:
        if event.event == "ALARM":
            return
        self.story.append(f"{event.event} {event.step_id} {event.step_kind} {event.code or ''}")
        match event.event:
            case "MISSION_ENDED":
                self.is_over = True
            case "STEP_ENDED" if event.code != "CUT":
                self._handle_end(event)
            case "STEP_FAILED":
                self._failed = event
                self._next_step = max(self._next_step, (event.step_id or 0) + 1)
                if event.station_id is None:
                    self.is_down = self.is_over = True
                if event.step_kind in ("DELIVER", "RETURN"):
                    self._unsure |= set(self._planned(event.step_id))
        if event.station_id is not None:
            load = {key: self._mass(key) for key, at in self.places.items() if at == "drone"}
            self._standing = Standing(event.station_id, event.soc, load)

    def _handle_end(self, event: DroneEvent) -> None:
        self._plans_in_vain = 0
        self._next_step = max(self._next_step, (event.step_id or 0) + 1)
        for package_id in event.package_ids:
            is_pick_up = event.step_kind == "PICK_UP"
            self.places[package_id] = "drone" if is_pick_up else str(event.step_kind)

    def _planned(self, step_id: int | None) -> tuple[str, ...]:
        return next(
            (
                tuple(getattr(step, "package_ids", ()))
                for step in self.steps
                if step.step_id == step_id
            ),
            (),
        )

    def _mass(self, package_id: str) -> float:
        return self._parcels[package_id].mass_kg

    # What goes

    async def run(self) -> None:
        """Look after the drone for ever."""
        self._send_mission(self._plan(self._standing, first_step=1))
        while True:
            await self._clock.sleep_wall(_LOOK_EVERY_S)
            if not self.mail.is_silent:
                self._look()

    async def deliver_time(self) -> None:
        while True:
            if not self.mail.is_silent:
                self._air.deliver_time()
            await self._clock.sleep_wall(_CLOCK_EVERY_S)

    def _look(self) -> None:
        state = self.state
        if state is None:
            return
        if state.last_event_seq > self.mail.events_through:
            self._ask_for_events()
            return
        if self._is_asked or self.is_over:
            return
        if self._is_cancelled:
            self.is_over = state.mission_id is None
        elif self._failed is not None:
            self._answer_failure(self._failed)
        elif self._accepted_revision == 0:
            self._send_mission(self._plan(self._standing, first_step=1))
        elif self._is_loading and state.activity == "LOADING":
            self._confirm_loading(state)

    def _ask_for_events(self) -> None:
        if self._clock.elapsed_s - self._asked_at > 3 * self._clock.rate:
            self._asked_at = self._clock.elapsed_s
            self.request_report()

    def request_report(self) -> None:
        self.mail.send("REPORT", lambda *_: None, events_after_seq=self.mail.events_through)

    def _answer_failure(self, failed: DroneEvent) -> None:
        if (failed.mission_revision or 0) < self._accepted_revision:
            self._failed = None  # a newer plan was accepted behind it
            return
        self._plans_in_vain += 1
        if failed.code == "INSUFFICIENT_ENERGY":
            self._factor = min(6.0, self._factor * 1.2)
        if self._plans_in_vain > _MOST_PLANS:
            self.cancel()
            return
        self._send_mission(self._plan(self._standing, first_step=self._next_step))

    def _plan(self, standing: Standing, *, first_step: int) -> list[FlightStep]:
        return self._planned_from(standing, first_step=first_step, delivers=True)

    def _planned_from(
        self, standing: Standing, *, first_step: int, delivers: bool
    ) -> list[FlightStep]:
        """The steps that are left to do from there; none when there is no way."""
        known = self.state.health.consumption_factor if self.state and self.state.health else 1.0
        factor = max(self._factor, known) * 1.03
        plan = Plan(standing, at=self._clock.now(), first_step=first_step, factor=factor)
        left = [one for key, one in self._parcels.items() if self.places[key] == "pickup"]
        aboard = [self._parcels[key] for key in standing.load]
        try:
            if delivers and left and not aboard:
                plan.fly_to(HOME)
                plan.pick_up(left, awaits_confirmation=self._is_loading)
                aboard = left
            for parcel in aboard if delivers else ():
                if parcel.package_id not in self._unsure:
                    plan.deliver(parcel)
            back = [
                one.package_id for one in aboard if not delivers or one.package_id in self._unsure
            ]
            if back:
                plan.bring_back(back)
            plan.fly_to(HOME)
        except NoWay:
            return []
        if not plan.steps:
            plan.wait(1.0)
        return plan.steps

    def _send_mission(self, steps: list[FlightStep], **other: Any) -> None:
        if not steps:
            self.cancel()
            return
        self._ask("MISSION", steps, first_step=steps[0].step_id, **other)

    def _ask(self, kind: str, steps: list[FlightStep], **fields: Any) -> None:
        self._revision += 1
        self._is_asked = True
        self.mail.send(
            kind,
            self._revision_answered,
            mission_id="msn_1",
            mission_revision=self._revision,
            delivery_id="dlv_1",
            steps=tuple(steps),
            **fields,
        )

    def _revision_answered(self, instruction: AnyInstruction, ack: Ack) -> None:
        self._is_asked = False
        self.story.append(
            f"{instruction.kind} {instruction.mission_revision} {ack.status} {ack.code or ''}"
        )
        if ack.status == "REJECTED":
            if ack.code == "INSUFFICIENT_ENERGY":
                self._factor = min(6.0, self._factor * 1.2)
            if ack.code == "STEP_RELEASED":
                self._next_step = max(self._next_step, int(ack.data["released_through"]) + 1)
            if self._accepted_revision == 0 or self._failed is not None:
                self._plans_in_vain += 1
                if self._plans_in_vain > _MOST_PLANS:
                    self.cancel()
            return
        self._accepted_revision = instruction.mission_revision or 0
        first_step = int(getattr(instruction, "first_step", 0))
        kept = [step for step in self.steps if step.step_id < first_step]
        self.steps = [*kept, *getattr(instruction, "steps", ())]
        if getattr(instruction, "loaded", None) is not None:
            self._is_loading = False

    def _confirm_loading(self, state: DroneState) -> None:
        """The loader has put everything on board."""
        ahead = [step for step in self.steps if step.step_id > (state.step_id or 0)]
        step = next((one for one in self.steps if one.step_id == state.step_id), None)
        if isinstance(step, PickUpStep) and ahead:
            loaded = tuple(
                PackageOnBoard(package_id=one.package_id, mass_kg=one.mass_kg * 1.02)
                for one in step.packages
            )
            self._send_mission(ahead, loaded=loaded)

    # What people wish for

    def await_loading(self) -> None:
        """Make the pickup wait for a loader's confirmation."""
        self._is_loading = True

    def hold(self) -> None:
        self._command("HOLD", reason="wish")

    def resume(self) -> None:
        self._command("RESUME")

    def cancel(self) -> None:
        if not self.is_over and not self._is_asked:
            self._is_asked = True
            self._command("CANCEL", self._cancel_answered, reason="wish")

    def _cancel_answered(self, instruction: AnyInstruction, ack: Ack) -> None:
        self._is_asked = False
        self._is_cancelled = ack.status == "ACCEPTED"
        self.story.append(f"CANCEL {ack.status} {ack.code or ''}")

    def _command(self, kind: str, answered: Any = lambda *_: None, **fields: Any) -> None:
        self.mail.send(
            kind,
            answered,
            mission_id="msn_1",
            mission_revision=max(1, self._revision),
            **fields,
        )

    def divert(self, *, overrides: bool = False) -> None:
        self._replace("DIVERT", overrides=overrides, delivers=True)

    def return_home(self, *, overrides: bool = False) -> None:
        self._replace("RETURN_HOME", overrides=overrides, delivers=False)

    def _replace(self, kind: str, *, overrides: bool, delivers: bool) -> None:
        """New steps after the step under way, or in its place where it can be cut."""
        is_fit = self._accepted_revision and self._failed is None and not self._is_cancelled
        ahead = [step for step in self.steps if step.step_id >= self._next_step]
        if self._is_asked or self.is_over or not is_fit or not ahead:
            return
        under_way = ahead[0]
        if isinstance(under_way, WaitStep | RechargeStep | PickUpStep):
            kept: list[FlightStep] = []
        else:
            kept = [under_way]
        if kept and isinstance(under_way, FlyStep):
            kept = [under_way.model_copy(update={"lands": True})]
        standing = standing_after(self._standing, kept, factor=max(1.0, self._factor))
        steps = self._planned_from(
            replace(standing, soc=max(0.0, standing.soc)),
            first_step=under_way.step_id + len(kept),
            delivers=delivers,
        )
        if steps:
            self._ask(
                kind,
                steps,
                last_valid_step=steps[0].step_id - 1,
                reason="wish",
                overrides_failsafe=overrides,
            )
