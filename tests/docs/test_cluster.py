"""docs/cluster.md and the files beside it: they are what SLURM, KubeRay and our own command line take."""

import re
import shlex
import subprocess
from collections.abc import Mapping

import pytest
from mcap_landmarks.cli.main import build, verbs
from ruamel.yaml import YAML
from typer.testing import CliRunner

from tests.docs.documents import DOCS

FILES = DOCS / "cluster"
SPEC = {
    # Of KubeRay 1.5.1's types (ray-operator/apis/ray/v1): the fields that a file of ours may have.
    "job": {"entrypoint", "shutdownAfterJobFinishes", "ttlSecondsAfterFinished", "activeDeadlineSeconds"}
    | {"rayClusterSpec", "submissionMode", "backoffLimit"},
    "cluster": {"rayVersion", "authOptions", "enableInTreeAutoscaling", "autoscalerOptions"}
    | {"headGroupSpec", "workerGroupSpecs"},
    "head": {"rayStartParams", "template", "serviceType"},
    "group": {"groupName", "replicas", "minReplicas", "maxReplicas", "rayStartParams", "template"},
    "pod": {"containers", "terminationGracePeriodSeconds", "volumes", "serviceAccountName", "nodeSelector"},
    "container": {"name", "image", "envFrom", "env", "ports", "resources", "volumeMounts"},
}


def commands(text: str) -> list[str]:
    """The lines that call us, as one line each."""
    joined = re.sub(r"\\\n\s*", " ", text)
    return [found.strip() for found in re.findall(r"mcap-landmarks (batch \w+ [^`\n]*)", joined)]


@pytest.fixture(scope="module")
def job() -> Mapping[str, object]:
    document: Mapping[str, object] = YAML(typ="safe").load((FILES / "rayjob.yaml").read_text())
    return document


def test_the_job_has_fields_that_kuberay_knows(job: dict) -> None:
    assert (job["apiVersion"], job["kind"]) == ("ray.io/v1", "RayJob")
    assert job["spec"].keys() <= SPEC["job"]
    spec = job["spec"]["rayClusterSpec"]
    assert spec.keys() <= SPEC["cluster"]
    assert spec["headGroupSpec"].keys() <= SPEC["head"]
    groups = [spec["headGroupSpec"], *spec["workerGroupSpecs"]]
    assert all(group.keys() <= SPEC["group"] for group in groups[1:])
    for group in groups:
        assert all(isinstance(value, str) for value in group["rayStartParams"].values()), "they are strings there"
        pod = group["template"]["spec"]
        assert pod.keys() <= SPEC["pod"]
        (container,) = pod["containers"]
        assert container.keys() <= SPEC["container"]
        assert container["envFrom"] == [{"secretRef": {"name": "landmarks-storage"}}]
        assert container["resources"]["requests"] == container["resources"]["limits"]
    assert spec["authOptions"] == {"mode": "token"}


def test_the_job_and_its_image_have_one_version_of_ray(job: dict) -> None:
    image = (FILES / "Dockerfile").read_text()
    assert f"ray[default]=={job['spec']['rayClusterSpec']['rayVersion']}" in image
    assert "wget" in image, "KubeRay's probes call it"


def test_the_sbatch_file_is_a_script() -> None:
    subprocess.run(["bash", "-n", FILES / "batch.sbatch"], check=True)
    text = (FILES / "batch.sbatch").read_text()
    lines = text.splitlines()
    first = next(i for i, line in enumerate(lines) if line and not line.startswith("#"))
    assert all(i < first for i, line in enumerate(lines) if line.startswith("#SBATCH")), "sbatch reads no others"


@pytest.mark.parametrize(
    "command",
    [
        *commands((DOCS / "cluster.md").read_text()),
        *commands((FILES / "batch.sbatch").read_text()),
        *commands(YAML(typ="safe").load((FILES / "rayjob.yaml").read_text())["spec"]["entrypoint"]),
    ],
)
def test_commands_parse(command: str) -> None:
    """Their options are those of batch or of the verb."""
    _, verb, *words = shlex.split(command)
    assert verb in verbs()
    shown = "".join(
        CliRunner().invoke(build(name), [name, "--help"], env={"COLUMNS": "200"}).output for name in ("batch", verb)
    )
    asked = [word for word in words if word.startswith("-")]
    assert "-o" in asked
    for word in asked:
        assert re.search(rf"(?<![\w-]){re.escape(word)}(?![\w-])", shown), f"{verb} has no option {word}"
