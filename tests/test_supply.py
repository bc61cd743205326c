# SPDX-License-Identifier: Apache-2.0
"""The project's dependencies: pins with hashes, licences, and known vulnerabilities."""

import json
import re
from pathlib import Path

import pytest
import yaml

import advisories
import sbom

ROOT = Path(__file__).parent.parent
REQUIREMENTS = ROOT / "requirements"
LOCKED = REQUIREMENTS / "locked"
#: Peers of the benchmarks, which nothing installs.
UNLOCKED = {"bench.txt"}


def listed(path: Path) -> dict[str, str]:
    pairs = (line.split("==") for line in path.read_text().splitlines() if "==" in line)
    return {sbom.plain(name): version for name, version in pairs}


@pytest.mark.parametrize("path", sorted(REQUIREMENTS.glob("*.txt")), ids=lambda path: path.name)
def test_every_list_is_pinned_and_locked(path: Path) -> None:
    lines = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
    assert all(re.fullmatch(r"[A-Za-z0-9._-]+==[^\s;]+", line) for line in lines), path
    if path.name not in UNLOCKED:
        assert sbom.pins((path.stem,)) == listed(path)


@pytest.mark.parametrize("path", sorted(LOCKED.glob("*.txt")), ids=lambda path: path.name)
def test_every_locked_pin_has_its_hashes(path: Path) -> None:
    entries = re.split(r"\n(?=\S)", path.read_text().strip())
    for entry in entries:
        head, *hashes = [line.strip().removesuffix("\\").strip() for line in entry.splitlines()]
        # a condition would leave a Python without its hash
        assert re.fullmatch(r"[a-z0-9._-]+==[^\s;]+", head), head
        assert hashes, head
        assert all(re.fullmatch(r"--hash=sha256:[0-9a-f]{64}", one) for one in hashes), head


def test_versions_of_all_lists_agree() -> None:
    seen: dict[str, str] = {}
    for name in advisories.ALL_LISTS:
        for package, version in sbom.pins((name,)).items():
            assert seen.setdefault(package, version) == version, package


@pytest.fixture(scope="module")
def bill() -> dict[str, list[dict[str, object]]]:
    return json.loads((REQUIREMENTS / "sbom.json").read_text())


def test_the_bill_of_materials_is_of_the_pins(bill) -> None:
    components = {sbom.plain(one["name"]): one["version"] for one in bill["components"]}
    assert components == sbom.pins()
    assert all(one["purl"].startswith("pkg:pypi/") for one in bill["components"])
    assert bill["bomFormat"] == "CycloneDX"


def test_every_package_has_its_licence(bill) -> None:
    for one in bill["components"]:
        words = [
            entry.get("expression") or entry["license"].get("id") or entry["license"]["name"]
            for entry in one["licenses"]
        ]
        assert words, one["name"]
        assert all(words), one["name"]


def test_no_file_of_it_names_a_host_of_packages(bill) -> None:
    for path in [REQUIREMENTS / "sbom.json", *REQUIREMENTS.rglob("*.txt")]:
        assert not re.search(r"https?://\S*(pypi|pythonhosted)", path.read_text()), path
    assert not any("externalReferences" in one for one in bill["components"])


def test_a_bill_keeps_pins_only_and_finds_licences(tmp_path: Path) -> None:
    share = tmp_path / "share" / "action_msgs"
    share.mkdir(parents=True)
    (share / "package.xml").write_text("<package><license>Apache License 2.0</license></package>")
    pins = sbom.pins()

    def one(name: str, version: str, **more: object) -> dict[str, object]:
        ref = f"{name}=={version}"
        return {
            "type": "library",
            "name": name,
            "version": version,
            "purl": "p",
            "bom-ref": ref,
        } | more

    raw = {
        "$schema": "s",
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "components": [
            one("ros-action-msgs", pins["ros-action-msgs"], externalReferences=[{}]),
            one("NumPy", pins["numpy"], licenses=[{"license": {"id": "BSD-3-Clause"}}]),
            one("empy", pins["empy"]),
            one("pip", "1.0"),
            one("scipy", "0.1"),
        ],
        "dependencies": [
            {"ref": f"NumPy=={pins['numpy']}", "dependsOn": ["pip==1.0"]},
            {"ref": "pip==1.0"},
        ],
    }
    made = sbom.bill(raw, tmp_path / "share")
    assert [entry["name"] for entry in made["components"]] == ["empy", "NumPy", "ros-action-msgs"]
    assert [entry["licenses"] for entry in made["components"]] == [
        [{"expression": "LGPL-2.1-or-later"}],
        [{"license": {"id": "BSD-3-Clause"}}],
        [{"expression": "Apache-2.0"}],
    ]
    assert made["dependencies"] == [{"ref": f"NumPy=={pins['numpy']}", "dependsOn": []}]


# ---- known-vulnerable pins


def advisory(number: str, events: list[dict[str, str]], **more: object) -> dict[str, object]:
    entry = {
        "package": {"name": "NumPy", "ecosystem": "PyPI"},
        "ranges": [{"type": "ECOSYSTEM", "events": events}],
    }
    return {"id": number, "modified": "2026-01-02T03:04:05Z", "affected": [entry]} | more


@pytest.mark.parametrize(
    ("events", "affected"),
    [
        ([{"introduced": "0"}, {"fixed": "2.5"}], True),
        ([{"introduced": "0"}, {"fixed": "2.4.6"}], False),
        ([{"introduced": "0"}, {"last_affected": "2.4.6"}], True),
        ([{"introduced": "0"}, {"last_affected": "2.4.5"}], False),
        ([{"introduced": "2.5"}], False),
        ([{"introduced": "1"}, {"fixed": "1.5"}, {"introduced": "2"}], True),
        ([{"introduced": "1"}, {"fixed": "1.5"}], False),
    ],
)
def test_ranges_of_advisories(tmp_path: Path, events, affected: bool) -> None:
    (tmp_path / "one.json").write_text(json.dumps(advisory("X-1", events)))
    found, newest = advisories.check(tmp_path, {"numpy": "2.4.6", "scipy": "1.0"})
    assert [str(one) for one in found] == ["numpy 2.4.6: X-1"] * affected
    assert newest == "2026-01-02"


def test_advisories_by_version_in_yaml_and_withdrawn_ones(tmp_path: Path) -> None:
    one = advisory("X-2", [])
    one["affected"][0]["versions"] = ["2.4.6"]
    (tmp_path / "one.yaml").write_text(yaml.safe_dump(one))
    (tmp_path / "two.json").write_text(
        json.dumps(advisory("X-3", [{"introduced": "0"}], withdrawn="2026-02-02"))
    )
    (tmp_path / "other.json").write_text(
        json.dumps(advisory("X-4", [{"introduced": "0"}])).replace("PyPI", "npm")
    )
    found, _ = advisories.check(tmp_path, {"numpy": "2.4.6"})
    assert [str(one) for one in found] == ["numpy 2.4.6: X-2"]


def test_the_check_of_advisories(tmp_path: Path, capsys, monkeypatch) -> None:
    monkeypatch.delenv("ARES_ADVISORIES", raising=False)
    assert advisories.main([]) == 0
    assert capsys.readouterr().out.startswith("advisories: not checked: no database")
    assert advisories.main([str(tmp_path)]) == 2
    capsys.readouterr()
    version = sbom.pins()["numpy"]
    monkeypatch.setenv("ARES_ADVISORIES", str(tmp_path))
    (tmp_path / "one.json").write_text(json.dumps(advisory("X-5", [{"introduced": "0"}])))
    assert advisories.main([]) == 1
    assert f"numpy {version}: X-5" in capsys.readouterr().err
    (tmp_path / "one.json").write_text(json.dumps(advisory("X-5", [{"introduced": "99"}])))
    assert advisories.main([]) == 0
    assert re.search(r"0 known for \d+ pins; .* 2026-01-02", capsys.readouterr().out)


def test_ci_checks_before_it_tests() -> None:
    assert "make audit && exec make test" in (ROOT / ".ci" / "run").read_text()
