"""What each delivery sees of a shared mission: its own packages, plan, price and reports."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from skyway.contracts.drone_report import DroneEvent
from skyway.contracts.flight_step import DeliverStep, FlightStep, PickUpStep, ReturnStep
from skyway.contracts.margins import Margins
from skyway.contracts.mission import Mission, PackageEta
from skyway.delivery.plan import Deliver, Fly, PickUp, Plan, Recharge, Step, Wait
from skyway.ids import DeliveryId, PackageId
from skyway_composition.missions.mission.record import MissionRecord
from skyway_composition.missions.mission.share import Share
from skyway_composition.missions.mission.step_store import StepRecord

#: These reports are only about the packages that they name.
_OF_PACKAGES: Final = (
    "LOADED",
    "PROOF_AWAITED",
    "PIN_ENTERED",
    "DELIVERED",
    "RETURNING",
    "RETURNED",
    "RELEASED",
)

#: These reports say why the trip is not flown as planned; the others say what has happened.
_OF_THE_PLAN: Final = ("REPLANNING", "REPLANNED", "REFUSED")

#: The one who cancels packages gives the reason. Other reasons may lie with another customer.
_OWN_REASONS: Final = ("CANCELLED", "CANCELLED_BY_OPERATOR")

#: Members of the evidence that say nothing about packages of others.
_OF_THE_DRONE: Final = ("place", "flown")


def owner_of(record: MissionRecord, package_id: PackageId) -> tuple[DeliveryId, PackageId]:
    """The delivery of a package that flies with this mission, and the customer's id of it."""
    for each in record.shares:
        if package_id in each.packages:
            return each.delivery_id, each.packages[package_id]
    return record.mission.delivery_id, package_id


def flown_for(record: MissionRecord, delivery_id: DeliveryId) -> Share | None:
    """The share of a delivery; None if the mission is not shared, or flies for other deliveries."""
    return next((each for each in record.shares if each.delivery_id == delivery_id), None)


def own_ids(
    record: MissionRecord, delivery_id: DeliveryId, package_ids: Iterable[PackageId]
) -> tuple[PackageId, ...]:
    """The customer's ids of the packages that belong to the delivery; others are left out."""
    share = flown_for(record, delivery_id)
    return tuple(package_ids) if share is None else share.own(package_ids)


def flying_ids(
    record: MissionRecord, delivery_id: DeliveryId, package_ids: Iterable[PackageId]
) -> tuple[PackageId, ...]:
    """The ids under which packages of the delivery fly with this mission."""
    share = flown_for(record, delivery_id)
    return tuple(package_ids) if share is None else share.flying(package_ids)


def serves(record: MissionRecord, delivery_id: DeliveryId) -> bool:
    """Whether the mission flies for this delivery, alone or among others."""
    is_shared = flown_for(record, delivery_id) is not None
    return is_shared or record.mission.delivery_id == delivery_id


def missions_seen(record: MissionRecord) -> tuple[Mission, ...]:
    """The mission as each of its deliveries sees it."""
    if not record.shares:
        return (record.mission,)
    return tuple(mission_of(record, each) for each in record.shares)


def mission_for(record: MissionRecord, delivery_id: DeliveryId) -> Mission:
    """The mission as this delivery sees it."""
    share = flown_for(record, delivery_id)
    return record.mission if share is None else mission_of(record, share)


def mission_of(record: MissionRecord, share: Share) -> Mission:
    """The mission as one of its deliveries sees it: up to its own last hand-over."""
    mission, plan = record.mission, _own_plan(record, share)
    doubt = mission.doubt
    return mission.model_copy(
        update={
            "mission_id": share.mission_id,
            "delivery_id": share.delivery_id,
            "attempt": share.attempt,
            "trip": share.trip,
            "price": share.charged,
            "payment_terms": share.payment_terms,
            "is_pooled": share.is_pooled,
            "packages": _own_etas(share, mission.packages),
            "plan": plan,
            "margins": _own_margins(mission.margins, plan),
            "pickup_away_m": 0.0 if share.near is None else share.near.away_m,
            "home_plan": None,
            "home_recharge": None,
            # The sentence may name packages of others.
            "doubt": doubt and doubt.model_copy(update={"detail": f"in doubt: {doubt.code}"}),
        }
    )


def _own_margins(margins: Margins, plan: Plan) -> Margins:
    """The margins without the ends of a flight that is not in the plan of the share."""
    flights = {(each.from_id, each.to_id) for each in plan.steps if isinstance(each, Fly)}
    risk = margins.risk
    if risk is None or (risk.from_id, risk.to_id) in flights:
        return margins
    hidden = risk.model_copy(update={"from_id": None, "to_id": None})
    return margins.model_copy(update={"risk": hidden})


def _own_etas(share: Share, etas: Sequence[PackageEta]) -> tuple[PackageEta, ...]:
    return tuple(
        PackageEta(package_id=share.packages[each.package_id], eta_at=each.eta_at)
        for each in etas
        if each.package_id in share.packages
    )


def _own_plan(record: MissionRecord, share: Share) -> Plan:
    """The plan with the share's packages only; hand-overs to others are shown as waiting."""
    plan = record.mission.plan
    steps = _up_to_last_hand_over([*_own_steps(record, share)])
    own = [each for each in plan.deliveries if each.package_id in share.packages]
    flights = [each for each in steps if isinstance(each, Fly)]
    return plan.model_copy(
        update={
            "steps": tuple(steps),
            "deliveries": tuple(
                each.model_copy(update={"package_id": share.packages[each.package_id]})
                for each in own
            ),
            "delivery_time_s": max((each.delivered_s for each in own), default=0.0),
            "lower_bound_s": None,
            "energy_j": sum(each.energy_j for each in flights),
            "flight_s": sum(each.end_s - each.start_s for each in flights),
            "waiting_s": _duration_s(steps, Wait),
            "recharging_s": _duration_s(steps, Recharge),
            "stats": {},
        }
    )


def _duration_s(steps: Sequence[Step], kind: type[Wait | Recharge]) -> float:
    return sum(each.end_s - each.start_s for each in steps if isinstance(each, kind))


def _own_steps(record: MissionRecord, share: Share) -> Iterator[Step]:
    """The steps of the plan with the packages and the load of this share."""
    masses_kg = {each.package_id: each.mass_kg for each in record.request.packages}
    delivered = {each.package_id for each in record.mission.plan.deliveries} & {*share.packages}
    steps = record.mission.plan.steps
    # The plan may begin before the packages are on board.
    on_board = set() if any(isinstance(each, PickUp) for each in steps) else set(delivered)
    for step in steps:
        match step:
            case PickUp():
                on_board = set(delivered)
                yield step.model_copy(update={"package_ids": share.own(step.package_ids)})
            case Deliver():
                on_board -= {*step.package_ids}
                own = share.own(step.package_ids)
                if own:
                    yield step.model_copy(update={"package_ids": own})
                else:
                    yield Wait(station_id=step.station_id, start_s=step.start_s, end_s=step.end_s)
            case Fly():
                load_kg = sum(masses_kg.get(each, 0.0) for each in on_board)
                yield step.model_copy(update={"load_kg": load_kg})
            case _:
                yield step


def _up_to_last_hand_over(steps: Sequence[Step]) -> Sequence[Step]:
    last = max((n for n, each in enumerate(steps, 1) if isinstance(each, Deliver)), default=0)
    return steps[:last]


def _own_step(step: FlightStep, share: Share) -> FlightStep | None:
    """A step with the share's packages only; None for a hand-over to others."""
    match step:
        case PickUpStep():
            packages = tuple(
                each.model_copy(update={"package_id": share.packages[each.package_id]})
                for each in step.packages
                if each.package_id in share.packages
            )
            return step.model_copy(update={"packages": packages})
        case DeliverStep() | ReturnStep():
            own = share.own(step.package_ids)
            changed: dict[str, object] = {"package_ids": own}
            if isinstance(step, DeliverStep):
                # The addresses of pictures are for the drone only.
                changed["verification"] = ()
            return step.model_copy(update=changed) if own else None
        case _:
            return step


def own_steps(
    record: MissionRecord, delivery_id: DeliveryId, steps: Sequence[StepRecord]
) -> Sequence[StepRecord]:
    """The steps with the packages of this delivery only, without hand-overs to others."""
    share = flown_for(record, delivery_id)
    if share is None:
        return steps
    shown = [(each, _own_step(each.step, share)) for each in steps]
    return [
        replace(each, step=step, event=_own_event(each.event, share))
        for each, step in shown
        if step is not None
    ]


def _own_event(event: DroneEvent | None, share: Share) -> DroneEvent | None:
    """The end of a step with the share's packages only."""
    if event is None:
        return None
    return event.model_copy(update={"package_ids": share.own(event.package_ids)})


#: The members of a report.
Fields = Mapping[str, Any]


def own_fields(record: MissionRecord, share: Share, kind: str, fields: Fields) -> Fields | None:
    """The members of a report for this share; None if the report is only about other shares."""
    named = tuple(fields.get("package_ids", ()))
    own = share.own(named)
    if kind in _OF_PACKAGES and named and not own:
        return None
    changed: dict[str, Any] = {
        "package_ids": own,
        "stranded_package_ids": share.own(fields.get("stranded_package_ids", ())),
        "etas": _own_etas(share, fields.get("etas", ())),
        "data": _own_data(share, fields.get("data", {})),
    }
    if fields.get("mission") is not None:
        changed["mission"] = mission_of(record, share)
    is_own_reason = own and len(own) == len(named) and fields.get("code") in _OWN_REASONS
    if fields.get("detail") is not None and not is_own_reason:
        # The reason may lie with another customer's packages, and name them.
        about = "the shared trip"
        if kind in _OF_THE_PLAN:
            about = "the shared trip cannot be flown as planned"
        changed["detail"] = f"{about}: {fields.get('code')}"
    return {**fields, **changed}


def _own_data(share: Share, data: Mapping[str, Any]) -> dict[str, Any]:
    """Evidence without the loads of others: places, times, and the masses of own packages."""
    shown = {name: data[name] for name in _OF_THE_DRONE if name in data}
    masses_kg = data.get("mass_kg")
    if isinstance(masses_kg, Mapping):
        shown["mass_kg"] = {
            share.packages[each]: mass_kg
            for each, mass_kg in masses_kg.items()
            if each in share.packages
        }
    return shown


def with_pooled_price(record: MissionRecord, loaded: Sequence[PackageId]) -> MissionRecord:
    """The record in which deliveries that were loaded together pay the pooled price."""
    together = [each for each in record.shares if each.own(loaded)]
    if len(together) <= 1:
        return record
    pooled = {each.mission_id for each in together}
    shares = tuple(
        each.model_copy(update={"is_pooled": each.is_pooled or each.mission_id in pooled})
        for each in record.shares
    )
    return replace(record, shares=shares)


def shown_mission(record: MissionRecord) -> Mission:
    """The whole mission, for operators and its provider; its price is that of the host."""
    if not record.shares:
        return record.mission
    host = record.shares[0]
    return record.mission.model_copy(update={"price": host.charged, "is_pooled": host.is_pooled})
