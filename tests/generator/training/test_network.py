"""The network, its loss, training and export; torch is an extra, so these are skipped where it is missing."""

from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")
import onnxruntime  # noqa: E402 - after what may skip
from mcap_landmarks.coco import NAMES  # noqa: E402
from mcap_landmarks.vision.config import DetectConfig  # noqa: E402
from mcap_landmarks.vision.detector import read_detector  # noqa: E402
from mcap_landmarks.vision.onnx_session import open_session  # noqa: E402
from mcap_landmarks_generator.training import exported, fitting  # noqa: E402
from mcap_landmarks_generator.training.examples import CLASS_IDS, Batch, Phase  # noqa: E402
from mcap_landmarks_generator.training.export import export, fused, with_all_classes  # noqa: E402
from mcap_landmarks_generator.training.loss import complete_iou, loss  # noqa: E402
from mcap_landmarks_generator.training.network import Decoded, Network  # noqa: E402

PARAMETERS = 1_872_157
# Names of the official file's layers, and where they are here.
LAYERS = {
    0: "to_p3.0", 1: "to_p3.1", 2: "to_p3.2", 3: "to_p3.3", 4: "to_p3.4", 5: "to_p4.0", 6: "to_p4.1", 7: "to_p5.0",
    8: "to_p5.1", 9: "to_p5.2", 10: "narrow_p5", 13: "down_p4", 14: "narrow_p4", 17: "out_p3", 18: "shrink_p3",
    20: "out_p4", 21: "shrink_p4", 23: "out_p5",
}  # fmt: skip
BLOCKS = {"cv1": "through", "cv2": "past", "cv3": "join"}
POOLING = {"cv1": "squeeze", "cv2": "join"}
BOTTLENECK = {"cv1": "squeeze", "cv2": "look"}


def _trained_a_little() -> Network:
    """A network whose normalisations have statistics of their own."""
    torch.manual_seed(1)
    network = Network("n", len(CLASS_IDS)).train()
    for _ in range(3):
        network(torch.rand(2, 3, 64, 96))
    return network.eval()


def test_it_has_as_many_weights_as_yolov5n() -> None:
    assert sum(weight.numel() for weight in Network("n", 80).parameters()) == PARAMETERS
    with torch.no_grad():
        rows = Decoded(Network("n", 80)).eval()(torch.zeros(1, 3, 640, 640))
    assert rows.shape == (1, 25200, 85)


def test_with_the_official_weights_it_says_what_the_official_model_says(shared_data: Path) -> None:
    path = shared_data / "models" / "yolov5n-coco.onnx"
    graph = onnx.load(path).graph
    weights = {w.name: torch.tensor(onnx.numpy_helper.to_array(w)) for w in graph.initializer}
    network = fused(Network("n", 80))
    state = {}
    for node in graph.node:
        if node.op_type == "Conv":
            state |= {f"{_ours(node.name)}.{what}": weights[node.input[i]] for i, what in ((1, "weight"), (2, "bias"))}
    known = network.state_dict()
    assert {name for name in known if name.endswith(("weight", "bias"))} == set(state)
    network.load_state_dict(state, strict=False)
    session = onnxruntime.InferenceSession(str(path), providers=["CPUExecutionProvider"])
    image = np.random.default_rng(0).random((1, 3, 640, 640), dtype=np.float32)
    (wanted,) = session.run(None, {session.get_inputs()[0].name: image})
    with torch.no_grad():
        given = Decoded(network).eval()(torch.from_numpy(image)).numpy()
    assert np.abs(given - wanted).max() < 0.05  # pixels, of up to 640: sums in another order
    assert np.abs(given[..., 4:] - wanted[..., 4:]).max() < 1e-4


def _ours(name: str) -> str:
    """Our name of a layer such as `/model.2/m/m.0/cv1/conv/Conv`."""
    _, number, *rest, _ = name.split("/")
    number = number.removeprefix("model.")
    if number == "24":
        return rest[0].replace("m.", "heads.")
    if rest[0] == "m":
        return ".".join([LAYERS[int(number)], rest[1].replace("m.", "bottlenecks."), BOTTLENECK[rest[2]], "conv"])
    if rest[0].startswith("cv"):
        return ".".join([LAYERS[int(number)], (POOLING if number == "9" else BLOCKS)[rest[0]], "conv"])
    return f"{LAYERS[int(number)]}.conv"


def test_complete_iou_of_equal_and_distant_boxes() -> None:
    boxes = torch.tensor([[10.0, 10, 4, 8], [10.0, 10, 4, 8]])
    others = torch.tensor([[10.0, 10, 4, 8], [30.0, 10, 4, 8]])
    same, apart = complete_iou(boxes, others).tolist()
    assert same == pytest.approx(1.0, abs=1e-5)
    assert apart == pytest.approx(-(20**2) / (24**2 + 8**2), abs=1e-5)


def test_the_loss_is_small_for_what_is_right_and_has_a_gradient() -> None:
    network = Network("n", 12)
    targets = torch.tensor([[0.0, 3, 100, 80, 40, 60], [1.0, 5, 30, 30, 12, 14]])
    raw = [out.detach().requires_grad_() for out in network(torch.rand(2, 3, 160, 160))]
    before = loss(raw, targets, network.anchors_px)
    optimizer = torch.optim.Adam(raw, 0.1)
    for _ in range(300):
        optimizer.zero_grad()
        loss(raw, targets, network.anchors_px).total.backward()
        optimizer.step()
    after = loss(raw, targets, network.anchors_px)
    assert after.box < 0.15 < before.box
    assert after.classes < 0.01 < before.classes
    rows = network.decode([out.detach() for out in raw])[0]
    best = rows[rows[:, 4].argmax()]
    assert best[:4].tolist() == pytest.approx([100, 80, 40, 60], abs=2)
    assert int(best[5:].argmax()) == 3


def test_an_export_says_what_the_network_says_under_cocos_names(tmp_path: Path) -> None:
    network, path = _trained_a_little(), tmp_path / "model.onnx"
    export(network, path, None, {"confidence": "0.4", "commit": "abc"})
    detector = read_detector(open_session(path), None, DetectConfig())
    assert detector.names == NAMES
    assert detector.layout.input_px == (None, None)
    assert set(detector.confidence.values()) == {0.4}
    image = torch.rand(1, 3, 96, 128)
    (rows,) = open_session(path).run(image.numpy())
    with torch.no_grad():
        wanted = network.decode(network(image)).numpy()
    assert np.abs(rows[..., :5] - wanted[..., :5]).max() < 1e-3
    assert np.abs(rows[..., 5 + CLASS_IDS] - wanted[..., 5:]).max() < 1e-5
    assert np.delete(rows[..., 5:], CLASS_IDS, axis=2).max() < 1e-6
    assert with_all_classes(fused(network)).numbers == 85


class _Noise:
    """Examples of noise, brighter from step to step."""

    def __len__(self) -> int:
        return 3

    def __getitem__(self, step: int) -> Batch:
        images = np.random.default_rng(step).integers(0, 80 * (step + 1), (4, 64, 64, 3), dtype=np.uint8)
        return Batch(images, np.zeros((0, 6), np.float32))


def test_an_export_read_back_says_the_same_and_goes_on_from_there(tmp_path: Path) -> None:
    network, path, image = _trained_a_little(), tmp_path / "model.onnx", torch.rand(1, 3, 64, 96)
    export(network, path, None, {})
    again = exported.read(path)
    with torch.no_grad():
        wanted = network(image)
        for given, known in zip(again(image), wanted, strict=True):
            assert torch.allclose(given, known, atol=1e-4)
        exported.calibrate(again, _Noise())  # type: ignore[arg-type]
        for given, known in zip(again(image), wanted, strict=True):
            assert torch.allclose(given, known, atol=1e-4)
    first, last = again.to_p3[0], again.out_p5.join
    assert first.norm.running_var.max() < 0.5  # type: ignore[union-attr]
    assert last.norm.running_var.std() > 0  # type: ignore[union-attr, operator]


class _TwoSteps:
    """Examples that are the same few noisy squares at every step."""

    def __len__(self) -> int:
        return 6

    def __getitem__(self, step: int) -> Batch:
        rng = np.random.default_rng(step)
        targets = np.array([[0, 2, 32, 32, 20, 30], [1, 4, 40, 20, 16, 16]], np.float32)
        return Batch(rng.integers(0, 255, (2, 64, 64, 3), dtype=np.uint8), targets)


def test_a_stopped_training_goes_on_as_if_it_had_not_stopped(tmp_path: Path) -> None:
    recipe, cpu = fitting.Recipe((Phase(6, 2, 64, 64),)), torch.device("cpu")
    whole = fitting.start(recipe, cpu)
    list(fitting.fit(whole, recipe, _TwoSteps(), tmp_path, save_every=100, beside=False))  # type: ignore[arg-type]
    stopped = fitting.start(recipe, cpu)
    steps = fitting.fit(stopped, recipe, _TwoSteps(), tmp_path, report_every=3, save_every=3, beside=False)  # type: ignore[arg-type]
    assert next(steps).step == 3
    steps.close()
    resumed = fitting.start(recipe, cpu, tmp_path / fitting.LAST)
    assert resumed.step == 3
    assert str(recipe.phases[0]) == "6x2x64x64" == str(Phase.parse("6x2x64x64"))
    list(fitting.fit(resumed, recipe, _TwoSteps(), tmp_path, save_every=100, beside=False))  # type: ignore[arg-type]
    kept = fitting.trained(tmp_path / fitting.LAST, cpu)
    assert kept.recipe == recipe
    for name, value in whole.average.state_dict().items():
        assert torch.equal(value, resumed.average.state_dict()[name]), name
