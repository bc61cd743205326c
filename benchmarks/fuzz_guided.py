# SPDX-License-Identifier: Apache-2.0
"""Try hostile input guided by coverage (atheris, of libFuzzer) on one target of benchmarks/fuzz.py.

    make atheris TARGET="mission files" FLAGS="-max_total_time=600"

Valid inputs of the target are mutated by it, and by libFuzzer, towards lines not yet reached. A
forbidden outcome ends the run; its input is kept in build/atheris-found.
"""

import sys
from pathlib import Path
from random import Random
from types import FunctionType

import atheris

from ares_node.entry import set_up_libraries

set_up_libraries()

# kernels cannot be compiled once atheris has been at them: all that has any comes first
from ares_models import (  # noqa: E402
    input_file,
    mission_arcs,
    mission_checks,
    mission_keys,
    mission_parts,
)

with atheris.instrument_imports(include=["ares_bags", "ares_bringup", "ares_view"]):
    import ares_view.live.server  # noqa: F401

for module in (input_file, mission_arcs, mission_checks, mission_keys, mission_parts):
    for name, value in vars(module).items():
        if isinstance(value, FunctionType) and value.__module__ == module.__name__:
            setattr(module, name, atheris.instrument_func(value))

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "tests"))

from hostile.run import pack  # noqa: E402
from hostile.targets import all_targets  # noqa: E402

ROOT = Path(__file__).resolve().parent.parent
CORPUS = ROOT / "build" / "atheris-corpus"
FOUND = ROOT / "build" / "atheris-found"
#: Inputs that the run begins with, and of those that follow, how many the target makes itself.
SEEDS = 64
OWN = 0.3


def main() -> None:
    """Run until a failure is found, or libFuzzer's options end the run."""
    name = sys.argv[1]
    named = {target.name: target for target in all_targets(ROOT / "bags" / "reference")}
    if name not in named:
        sys.exit(f"target is {name!r}; expected one of {', '.join(named)}")
    corpus = CORPUS / name.replace(" ", "_")
    corpus.mkdir(parents=True, exist_ok=True)
    FOUND.mkdir(parents=True, exist_ok=True)
    with named[name] as target:
        for number in range(SEEDS):
            (corpus / f"seed_{number}").write_bytes(target.make(Random(number)))

        def changed(data: bytes, most: int, seed: int) -> bytes:
            random = Random(seed)
            if random.random() < OWN:
                return target.make(random)[:most]
            return bytes(atheris.Mutate(data, most))

        def take(data: bytes) -> None:
            try:
                target.run(data)
            except Exception:
                (FOUND / f"{name.replace(' ', '_')}.bin").write_bytes(pack([data]))
                raise

        options = ["-timeout=10", "-max_len=65536", f"-artifact_prefix={FOUND}/"]
        argv = [sys.argv[0], *options, *sys.argv[2:], str(corpus)]
        atheris.Setup(argv, take, custom_mutator=changed)
        atheris.Fuzz()


if __name__ == "__main__":
    main()
