"""Compile every kernel once, so that the next start finds them in numba's cache."""

from ares_models.mission import load_mission
from ares_studies.closed_loop import fly_compiled, fly_stepwise


def main() -> None:
    """Fly the default mission both ways: whatever the nodes call is compiled by then."""
    mission = load_mission("ares_v")
    fly_compiled(mission)
    fly_stepwise(mission)


if __name__ == "__main__":
    main()
