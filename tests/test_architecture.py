"""Who may import whom (docs/architecture.md)."""

import ast
from pathlib import Path

import pytest

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
    "ares_bringup": {
        "ares_models",
        "ares_guidance",
        "ares_vehicle_sim",
        "ares_optimizer",
        "ares_studies",
        "ares_node",
        "ares_bags",
        "ares_msgs",
    },
}
#: A node, and the entry of its process.
NODES = {"node.py", "__main__.py"}
NODES_ALSO = {"ares_node", "ares_msgs"}
SPEAK_ROS = {"ares_node", "ares_bags", "ares_bringup"}
ROS = {"rclpy", "rosgraph_msgs", "diagnostic_msgs", "builtin_interfaces", "rcl_interfaces"}

MODULES = sorted(SOURCES.glob("ares_*/ares_*/**/*.py"))


def imported(module: Path) -> set[str]:
    """Top-level names of everything that a module imports."""
    names = set()
    for node in ast.walk(ast.parse(module.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module}: relative import"
            names.add(node.module.split(".")[0])
    return names


def test_every_package_has_its_rule():
    found = {module.relative_to(SOURCES).parts[0] for module in MODULES}
    assert found
    assert found <= set(MAY_IMPORT)


@pytest.mark.parametrize("module", MODULES, ids=lambda p: str(p.relative_to(SOURCES)))
def test_imports_follow_the_rules(module):
    package = module.relative_to(SOURCES).parts[0]
    names = imported(module)
    allowed = MAY_IMPORT[package] | {package}
    if module.name in NODES:
        allowed |= NODES_ALSO
    ours = {name for name in names if name.startswith("ares_")}
    assert ours <= allowed
    if package not in SPEAK_ROS and module.name not in NODES:
        assert not names & ROS


def test_the_rules_would_notice(tmp_path):
    bad = tmp_path / "core.py"
    bad.write_text("from ares_vehicle_sim import kernels\nimport rclpy.node\n")
    assert imported(bad) == {"ares_vehicle_sim", "rclpy"}
