"""Reading TensorFlow.js graph models."""

import json

import numpy as np
import pytest
from mcap_landmarks.errors import ModelError
from mcap_landmarks.networks.tfjs import read_graph

from tests.networks.tf_graphs import Built

WEIGHTS = np.array([[0.1, -2.5], [1e-3, 7.0]], np.float32)


def files(half: bool) -> tuple[bytes, bytes]:
    built = Built((1, 2), half=half)
    built.constant("count", np.array([3, -1], np.int32))
    built.constant("w", WEIGHTS)
    built.node("y", "Add", ["x", "w", "^count"], {"alpha": 0.5, "n": 2, "on": True, "pad": "SAME", "sides": [1, 2]})
    built.node("z", "Add", ["y", "w"], {"words": ["BiasAdd", "Relu"]})
    return built.files({"z": (2, 2)})


@pytest.mark.parametrize("half", [False, True])
def test_a_graph_is_read(half: bool) -> None:
    graph = read_graph(*files(half), "test")
    assert graph.inputs == {"x": (1, 2)}
    assert graph.outputs == {"z": (2, 2)}
    assert graph.nodes["y"].inputs == ("x", "w")  # what is only waited for is not read
    assert graph.nodes["y"].attributes == {"alpha": 0.5, "n": 2.0, "on": 1.0, "pad": "SAME", "sides": (1, 2)}
    assert graph.nodes["z"].attributes == {"words": "BiasAdd Relu"}
    assert graph.weights["count"].tolist() == [3, -1]
    expected = WEIGHTS.astype(np.float16).astype(np.float32) if half else WEIGHTS
    np.testing.assert_array_equal(graph.weights["w"], expected)
    assert graph.weights["w"].dtype == np.float32


def test_what_is_no_graph_is_refused() -> None:
    model, weights = files(half=False)
    document = json.loads(model)
    other = document | {"weightsManifest": [{"weights": [{"name": "w", "shape": [1], "dtype": "complex64"}]}]}
    huge = document | {"weightsManifest": [{"weights": [{"name": "w", "shape": [2**40], "dtype": "float32"}]}]}
    negative = document | {"weightsManifest": [{"weights": [{"name": "w", "shape": [-1], "dtype": "float32"}]}]}
    for content, given, said in (
        (b"no JSON", weights, "not a TensorFlow.js graph model"),
        (b"{}", weights, "modelTopology"),
        (model, weights[:-1], "23 bytes of weights do not reach for w"),
        (model, weights + b"1", "25 bytes of weights, where the graph has 24"),
        (json.dumps(other).encode(), weights, "dtype"),
        (json.dumps(huge).encode(), weights, "do not reach for w"),
        (json.dumps(negative).encode(), weights, "do not reach for w"),
    ):
        with pytest.raises(ModelError, match=r"nanodet\.json: not a TensorFlow\.js graph model") as error:
            read_graph(content, given, "nanodet.json")
        assert said in str(error.value)
