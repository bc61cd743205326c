# SPDX-License-Identifier: Apache-2.0
"""Allowed imports between packages (docs/architecture.md)."""

import ast
from functools import cache
from pathlib import Path

SOURCES = Path(__file__).parent.parent / "src"

MAY_IMPORT = {
    "ares_models": set(),
    # law optimal solves the optimizer's two-point problem on board
    "ares_guidance": {"ares_models", "ares_optimizer"},
    "ares_vehicle_sim": {"ares_models"},
    "ares_optimizer": {"ares_models"},
    "ares_studies": {"ares_models", "ares_guidance", "ares_vehicle_sim", "ares_optimizer"},
    "ares_node": {"ares_msgs"},
    "ares_bags": {"ares_node", "ares_msgs"},
    "ares_view": {"ares_models", "ares_studies", "ares_bags", "ares_node", "ares_msgs"},
    "ares_bringup": {
        "ares_models",
        "ares_guidance",
        "ares_vehicle_sim",
        "ares_optimizer",
        "ares_studies",
        "ares_node",
        "ares_bags",
        "ares_view",
        "ares_msgs",
    },
    "ares_thesis": {
        "ares_models",
        "ares_guidance",
        "ares_vehicle_sim",
        "ares_optimizer",
        "ares_studies",
        "ares_bringup",
    },
    "ares_trials": {
        "ares_models",
        "ares_guidance",
        "ares_vehicle_sim",
        "ares_optimizer",
        "ares_studies",
        "ares_node",
        "ares_bags",
        "ares_bringup",
        "ares_msgs",
    },
}
#: What no other package imports: their laws, methods and verbs are registered.
LEAVES = {"ares_thesis", "ares_trials"}
#: A node, its dealings with others of its flight, what it makes its messages with, and the entry of
#: its process.
NODES = {"node.py", "lock_step.py", "members.py", "messages.py", "__main__.py"}
NODES_ALSO = {"ares_node", "ares_msgs"}
SPEAK_ROS = {"ares_node", "ares_bags", "ares_view", "ares_bringup", "ares_trials"}
ROS = {"rclpy", "rosgraph_msgs", "diagnostic_msgs", "builtin_interfaces", "rcl_interfaces"}

#: First words of a docstring that leave open what the code does.
NO_VERBS = {"What", "Who", "Whether", "That", "How", "Where", "Why", "When", "Which", "As"}
#: Rooms of the optimizer, and which others each may import. What is in none is shared, or joins
#: them: it is named below.
OPTIMIZER = SOURCES / "ares_optimizer" / "ares_optimizer"
ROOMS = {
    "kernels": set(),
    "two_point": {"kernels"},
    "proof": set(),
    "direct": {"kernels", "proof"},
    # its gravity has the second derivatives that the two-point problem wrote
    "collocation": {"kernels", "two_point", "proof"},
    "indirect": {"kernels", "two_point", "proof"},
}
SHARED = {
    *("deadline", "floors", "methods", "obstacles", "pieces", "plan", "registry", "request"),
    *("results", "sensitivities", "solution", "targets"),
}
JOINS = {
    "auto",
    "floor_check",
    "out_of_reach",
    "payload",
    "window",
    "foreknown",
    "kept",
    "rival",
    "solve",
    "messages",
    "node",
    "worker",
    "__main__",
    "__init__",
}
#: What flight software may take from the optimizer.
ON_BOARD = {"ares_optimizer.two_point.arrays", "ares_optimizer.two_point.contract"}
#: What may be taken from the proof: it flies and judges, its physics stays inside.
PROOF = {f"ares_optimizer.proof.{name}" for name in ("flight", "checks", "held")}

MODULES = sorted(SOURCES.glob("ares_*/ares_*/**/*.py"))


@cache
def nodes(module: Path) -> list[ast.AST]:
    """Return all nodes of a module's syntax tree."""
    return list(ast.walk(ast.parse(module.read_text(encoding="utf-8"))))


@cache
def imports(module: Path) -> list[ast.Import | ast.ImportFrom]:
    """Return all imports of a module."""
    return [node for node in nodes(module) if isinstance(node, ast.Import | ast.ImportFrom)]


def imported(module: Path) -> set[str]:
    """Return the top-level names of all imports of a module."""
    names = set()
    for node in imports(module):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        else:
            assert node.level == 0, f"{module}: relative import"
            names.add(node.module.split(".")[0])
    return names


def imported_modules(module: Path) -> set[str]:
    """Return the full names of the modules that a module may import."""
    names = set()
    for node in imports(module):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        else:
            inner = {f"{node.module}.{alias.name}" for alias in node.names}
            names |= {name for name in inner if is_module(name)} or {node.module}
    return names


def is_module(name: str) -> bool:
    path = SOURCES / name.partition(".")[0] / name.replace(".", "/")
    return path.is_dir() or path.with_suffix(".py").is_file()


def test_every_package_has_its_rule():
    found = {module.relative_to(SOURCES).parts[0] for module in MODULES}
    assert found
    assert found <= set(MAY_IMPORT)
    for package, others in MAY_IMPORT.items():
        assert not others & LEAVES, package
        manifest = (SOURCES / package / "package.xml").read_text()
        for leaf in LEAVES - {package}:
            # a package's own tests may be of those that try it
            assert f"<exec_depend>{leaf}<" not in manifest, package


def test_imports_follow_the_rules():
    for module in MODULES:
        package = module.relative_to(SOURCES).parts[0]
        names = imported(module)
        allowed = MAY_IMPORT[package] | {package}
        if module.name in NODES:
            allowed |= NODES_ALSO
        ours = {name for name in names if name.startswith("ares_")}
        assert ours <= allowed, module
        if package not in SPEAK_ROS and module.name not in NODES:
            assert not names & ROS, module


def test_rooms_of_the_optimizer_keep_apart():
    for module in sorted(OPTIMIZER.rglob("*.py")):
        parts = module.relative_to(OPTIMIZER).with_suffix("").parts
        names = {name for name in imported_modules(module) if name.startswith("ares_optimizer.")}
        rooms = {name.split(".")[1] for name in names}
        assert rooms <= set(ROOMS) | SHARED | JOINS, module
        if len(parts) > 1:
            assert rooms <= ROOMS[parts[0]] | SHARED | {parts[0]}, module
        elif parts[0] in SHARED:
            assert rooms <= SHARED, module
        else:
            assert parts[0] in JOINS, module
        if parts[0] != "proof":
            assert {name for name in names if name.split(".")[1] == "proof"} <= PROOF, module


def test_the_proof_shares_nothing_with_the_solvers():
    for module in OPTIMIZER.glob("proof/*.py"):
        ours = {name for name in imported_modules(module) if name.startswith("ares_")}
        assert ours <= {
            "ares_models.arrays",
            "ares_models.jit",
            "ares_models.judge",
            "ares_models.tolerances",
            "ares_optimizer.request",
            "ares_optimizer.solution",
            "ares_optimizer.targets",
            *(f"ares_optimizer.proof.{path.stem}" for path in OPTIMIZER.glob("proof/*.py")),
        }


def test_flight_software_takes_the_two_point_problem_alone():
    for module in MODULES:
        names = {name for name in imported_modules(module) if name.startswith("ares_optimizer")}
        package = module.relative_to(SOURCES).parts[0]
        if package == "ares_guidance":
            assert names <= ON_BOARD, module
        elif package != "ares_optimizer":
            # a method of another package proves its solutions as those here do
            allowed = PROOF if package in LEAVES else set()
            proof = {name for name in names if name.startswith("ares_optimizer.proof")}
            assert proof <= allowed, module


def imports_of_imports(modules: list[Path], package: Path) -> dict[str, set[str]]:
    """Return each module's imports of its own package, by full name."""
    found = {}
    for module in modules:
        parts = module.relative_to(package.parent).with_suffix("").parts
        names = imported_modules(module)
        found[".".join(parts)] = {name for name in names if name.startswith(f"{package.name}.")}
    return found


def circle(graph: dict[str, set[str]]) -> list[str]:
    """Return modules that import each other: the rest after removing leaves."""
    left = {name: set(names) & set(graph) for name, names in graph.items()}
    while leaves := {name for name, names in left.items() if not names}:
        left = {name: names - leaves for name, names in left.items() if name not in leaves}
    return sorted(left)


def test_no_module_of_the_optimizer_imports_in_a_circle_or_late():
    modules = sorted(OPTIMIZER.rglob("*.py"))
    assert not circle(imports_of_imports(modules, OPTIMIZER))
    for module in modules:
        tree = ast.parse(module.read_text())
        inside = set(ast.walk(tree)) - set(tree.body)
        assert not [x for x in inside if isinstance(x, ast.Import | ast.ImportFrom)], module


def test_each_class_name_is_used_once():
    found = {}
    for module in sorted(SOURCES.glob("ares_*/**/*.py")):
        for node in nodes(module):
            if isinstance(node, ast.ClassDef):
                assert node.name not in found, f"{module} beside {found[node.name]}: {node.name}"
                found[node.name] = module


def test_a_circle_would_be_noticed():
    assert not circle({"a": {"b", "c"}, "b": {"c"}, "c": set()})
    assert circle({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == ["a", "b", "c", "d"]


def test_the_rules_would_notice(tmp_path):
    bad, worse = tmp_path / "core.py", tmp_path / "late.py"
    bad.write_text("from ares_optimizer.direct.kernels import sqp\nimport rclpy.node\n")
    assert imported(bad) == {"ares_optimizer", "rclpy"}
    assert imported_modules(bad) == {"ares_optimizer.direct.kernels.sqp", "rclpy.node"}
    worse.write_text("def f():\n    from ares_optimizer.proof.physics import gravity\n")
    assert imported(worse) == {"ares_optimizer"}
    assert imported_modules(worse) == {"ares_optimizer.proof.physics"}


def test_a_docstring_begins_with_what_the_code_does():
    """The linter asks for a verb in the imperative, and takes these words for one."""
    found = []
    for path in MODULES:
        for node in nodes(path):
            if isinstance(node, (ast.FunctionDef, ast.ClassDef, ast.AsyncFunctionDef, ast.Module)):
                first, *_ = (ast.get_docstring(node) or "-").split()
                if first.rstrip(",") in NO_VERBS:
                    found.append(f"{path.name}: {getattr(node, 'name', 'module')}: {first}")
    assert not found
