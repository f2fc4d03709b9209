"""Make one drive from the command line."""

import argparse
from pathlib import Path

from .driver import STYLES
from .gearboxes import VARIANTS, random_variant
from .make import TRUTH_RATE, make_drive
from .sensing import Logger
from .vehicle import KINDS, random_vehicle


def main(arguments: list[str] | None = None) -> None:
    parser = argparse.ArgumentParser(prog="second_model", description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--kind", choices=(*KINDS, *VARIANTS), default="petrol")
    parser.add_argument("--vehicle-seed", type=int, default=1)
    parser.add_argument(
        "--mass", type=float, help="kg; tare and a third of the payload if not given"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--duration", type=float, default=1800.0, help="s")
    parser.add_argument("--style", choices=STYLES, default="ordinary")
    parser.add_argument("--warm", type=float, help="0 cold to 1 warm; drawn if not given")
    parser.add_argument("--unload", type=float, default=0.0, help="kg taken off at stops")
    parser.add_argument("--rows", action="store_true", help="all values in each row")
    parser.add_argument("--rate", type=float, default=18.0, help="answers or rows per second")
    parser.add_argument("--torque", choices=("load", "nm", "percent", "indicated"))
    parser.add_argument("--any-mount", action="store_true")
    parser.add_argument("--gnss-speed", action="store_true")
    for name in (
        "brake-switch",
        "clutch-switch",
        "throttle",
        "gear",
        "air-flow",
        "retarder",
        "battery",
    ):
        parser.add_argument(f"--{name}", action="store_true")
    args = parser.parse_args(arguments)
    draw = random_variant if args.kind in VARIANTS else random_vehicle
    vehicle = draw(args.kind, args.vehicle_seed)
    mass = args.mass or vehicle.tare + (vehicle.gross - vehicle.tare) / 3.0
    logger = Logger(
        mode="rows" if args.rows else "polled",
        rate=args.rate,
        torque=args.torque,
        brake_switch=args.brake_switch,
        clutch_switch=args.clutch_switch,
        throttle=args.throttle,
        gear=args.gear,
        air_flow=args.air_flow,
        retarder=args.retarder,
        battery=args.battery,
        mount="any" if args.any_mount else "aligned",
        gnss_speed=args.gnss_speed,
    )
    truth = make_drive(
        args.folder,
        vehicle,
        mass=mass,
        seed=args.seed,
        duration=args.duration,
        style=args.style,
        logger=logger,
        warm=args.warm,
        unload=args.unload,
    )
    speed = truth["speed_mps"].to_numpy()
    print(
        f"{vehicle.name}: {mass:.0f} kg, {speed.sum() / TRUTH_RATE / 1000.0:.1f} km, "
        f"{speed.mean() * 3.6:.0f} km/h on the mean"
    )


if __name__ == "__main__":
    main()
