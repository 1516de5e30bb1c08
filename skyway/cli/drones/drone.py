"""`skyway drone`: the agent of one drone against a running Skyway."""

from typing import Annotated, NoReturn

import typer

from skyway.cli.data_folder import DataFolder, DataOption, data_folder
from skyway.cli.drones.agent_process import (
    AbsentOption,
    AltitudeOption,
    ApiOption,
    ChargeTimeOption,
    EnrolOption,
    FileArgument,
    FlightEnergyOption,
    FlightTimeOption,
    PayloadOption,
    RotateOption,
    ScenarioOption,
    SeedOption,
    SystemIdOption,
    VehicleOption,
    agent_arguments,
    become_agent,
    fly,
    read_drones,
)
from skyway.cli.gateway import fail


def drone_command(
    file: FileArgument = None,
    drone_id: Annotated[
        str | None, typer.Option(help="The drone's id, when FILE has several.")
    ] = None,
    enrol: EnrolOption = None,
    api: ApiOption = None,
    rotate: RotateOption = False,
    scenario: ScenarioOption = None,
    seed: SeedOption = None,
    flight_time_factor: FlightTimeOption = None,
    flight_energy_factor: FlightEnergyOption = None,
    charge_time_factor: ChargeTimeOption = None,
    absent_station: AbsentOption = None,
    vehicle: VehicleOption = None,
    payload: PayloadOption = None,
    altitude_m: AltitudeOption = None,
    system_id: SystemIdOption = None,
    data: DataOption = None,
) -> None:
    """Run the agent of one drone until Ctrl-C.

    Without FILE the drone has enrolled here before, or it enrols now with a token.
    """
    arguments = agent_arguments(
        {
            "scenario": scenario,
            "seed": seed,
            "flight-time-factor": flight_time_factor,
            "flight-energy-factor": flight_energy_factor,
            "charge-time-factor": charge_time_factor,
            "vehicle": vehicle,
            "payload": payload,
            "altitude-m": altitude_m,
            "system-id": system_id,
        },
        absent_station,
    )
    if file is None:
        _run_enrolled(
            data_folder(data), enrol, arguments + _enrolment_arguments(drone_id, api, rotate)
        )
    if enrol is not None or rotate:
        fail("--enrol and --rotate are for a drone without FILE")
    chosen = [drone for drone in read_drones(file) if drone_id in (None, drone["drone_id"])]
    if len(chosen) != 1:
        fail(f"{file} has {len(chosen)} drones to choose from: name one with --drone-id")
    fly(data_folder(data), chosen, arguments)


def _enrolment_arguments(drone_id: str | None, api: str | None, rotate: bool) -> list[str]:
    """The options of an enrolled drone as the agent's arguments."""
    named = {"--drone-id": drone_id, "--api": api}
    arguments = [f"{option}={value}" for option, value in named.items() if value is not None]
    return arguments + (["--rotate"] if rotate else [])


def _run_enrolled(folder: DataFolder, token: str | None, arguments: list[str]) -> NoReturn:
    """Become the agent of the drones that enrolled with this data folder."""
    secrets = {} if token is None else {"SKYWAY_ENROLMENT_TOKEN": token}
    become_agent(folder, arguments, settings=secrets)
