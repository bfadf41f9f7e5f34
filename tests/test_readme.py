"""The pages name what exists, and their programs without ROS run. The README's code: tests/newcomer/test_wheel.py;
programs with ROS: tests/node/test_tutorial.py."""

import re
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text()
# Imports of programs that other tests run, because these need a node, or another simulator.
ELSEWHERE = ("rclpy", "smartmesh_msgs", "smartmesh_ros.tools")


def test_the_page_of_parameters_is_that_of_the_node() -> None:
    """If not: scripts/workspace run dev -- python scripts/write_parameters.py"""
    from scripts.write_parameters import parameter_page

    page = (ROOT / "docs" / "parameters.md").read_text()
    assert page == parameter_page()


def test_parameters_that_the_pages_name_exist() -> None:
    from smartmesh_ros.node.parameters.specifications import SPECS

    names = {spec.name for spec in SPECS}
    groups = {name.partition(".")[0] for name in names if "." in name}
    for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        for name in re.findall(r"`(\w+\.\w+)(?::[^`]*)?`", page.read_text()):
            if name.partition(".")[0] in groups and not name.endswith((".py", ".xml", ".yaml", ".json")):
                assert name in names, f"{page.name}: {name}"


def test_parameter_files_of_the_pages_are_whole() -> None:
    from smartmesh_ros.node.parameters.specifications import SPECS

    names = {spec.name for spec in SPECS} | {"qos_overrides"}
    for page in [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]:
        for file in re.findall(r"```yaml\n(.*?)```", page.read_text(), re.DOTALL):
            assert yaml.safe_load(file)["/**"]["ros__parameters"].keys() <= names, page.name


def programs() -> dict[str, str]:
    """The programs without ROS of each page that has some."""
    found = {}
    for page in sorted((ROOT / "docs").glob("*.md")):
        codes = re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)
        alone = [code for code in codes if "import " in code and not any(words in code for words in ELSEWHERE)]
        if alone:
            found[page.stem] = alone
    return found


@pytest.mark.parametrize("page", programs())
def test_programs_of_the_pages_run(page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for code in programs()[page]:
        exec(compile(code, f"{page}.md", "exec"), {"__name__": page})


def test_links_lead_somewhere() -> None:
    for page in [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *(ROOT / "docs").glob("*.md")]:
        for target in re.findall(r"\]\(([^)#:]+)(?:#[^)]*)?\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name}: {target}"


def test_the_site_has_every_page_and_every_public_name() -> None:
    import smartmesh_ros

    pages = {page.name for page in (ROOT / "docs").glob("*.md")}
    assert set(re.findall(r"(\w+\.md)$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE)) == pages
    named = re.findall(r"^::: smartmesh_ros\.(\w+)$", (ROOT / "docs" / "api.md").read_text(), re.MULTILINE)
    assert set(named) == set(smartmesh_ros.__all__)


def test_the_oldest_python_is_the_same_everywhere() -> None:
    patterns = {
        "setup.py": r'python_requires=">=([\d.]+)"',
        "pyproject.toml": r'python_version = "([\d.]+)"',
        "smartmesh_ros/core/CMakeLists.txt": r"find_package\(Python ([\d.]+) ",
        "README.md": r"with Python ([\d.]+) to",
        "docs/installing.md": r"Linux on x86-64, Python ([\d.]+) to",
    }
    found = {file: re.findall(pattern, (ROOT / file).read_text()) for file, pattern in patterns.items()}
    assert found == {file: ["3.11"] for file in patterns}
