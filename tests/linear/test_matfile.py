"""The .mat file: what goes in comes out, in the shapes MATLAB and Scilab expect."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from fixtures import structures as s
from scipy.io import loadmat, savemat

from flexctrl.errors import LinearizationError, StructureError
from flexctrl.linear.matfile import Units, load_units
from flexctrl.linear.model import LinearModel
from flexctrl.linear.parts import PartMatrices


def machine() -> LinearModel:
    base = s.grid_frame(2, 3, alpha=0.1, beta=1e-4)
    n = len(base.coordinates)
    half = PartMatrices(0.5 * base.K, 0.25 * base.M)
    return s.model(
        base.M,
        base.K,
        C=base.C,
        B=np.eye(n)[:, :2],
        Cq=np.eye(n)[:1],
        Cv=np.eye(n)[1:2],
        D=[[0.1, 0.2]],
        inputs=("push", "pull"),
        outputs=("tip_x",),
        parts={"girder": half, "leg": half},
    )


def test_round_trip_is_exact(tmp_path):
    linear = machine()
    linear.save_mat(tmp_path / "frame.mat")
    back = LinearModel.load_mat(tmp_path / "frame.mat")
    for key in ("M", "C", "K"):
        assert (getattr(back, key) != getattr(linear, key)).nnz == 0
    for key in ("B", "Cq", "Cv", "D"):
        np.testing.assert_array_equal(getattr(back, key), getattr(linear, key))
    for key in ("coordinates", "inputs", "outputs", "name"):
        assert getattr(back, key) == getattr(linear, key)
    assert list(back.parts) == ["girder", "leg"]
    assert (back.parts["leg"].mass != linear.parts["leg"].mass).nnz == 0


def test_file_is_version_5_with_sparse_doubles_cells_and_units(tmp_path):
    path = tmp_path / "frame.mat"
    machine().save_mat(path)
    assert path.read_bytes().startswith(b"MATLAB 5.0")
    content = loadmat(path)
    assert sp.issparse(content["K"])
    assert content["K"].dtype == np.float64
    assert content["inputs"].shape == (2, 1)
    assert content["inputs"][0, 0][0] == "push"
    assert "kg" in content["units"][0]


def test_model_without_parts_or_inputs_comes_back(tmp_path):
    linear = s.six_mass_chain().select(inputs=[])
    linear.save_mat(tmp_path / "chain.mat")
    back = LinearModel.load_mat(tmp_path / "chain.mat")
    assert back.inputs == ()
    assert back.B.shape == (6, 0)
    assert not back.parts


def test_another_file_is_refused(tmp_path):
    savemat(str(tmp_path / "other.mat"), {"A": np.eye(2)})
    with pytest.raises(LinearizationError, match="missing"):
        LinearModel.load_mat(tmp_path / "other.mat")


def test_units_are_those_given(tmp_path):
    path = tmp_path / "frame.mat"
    machine().save_mat(path)
    assert load_units(path) == Units()
    assert "time s" in str(loadmat(path)["units"][0])
    millimetres = Units("mm", "t", "s", "N")
    machine().save_mat(path, millimetres)
    assert load_units(path) == millimetres
    text = str(loadmat(path)["units"][0])
    assert "length mm, mass t" in text
    assert "kg" not in text
    with pytest.raises(StructureError, match="mass = ''"):
        Units(mass="")
    content = {k: v for k, v in loadmat(path).items() if not k.startswith("__")}
    savemat(path, content | {"units": text.replace("mm", "parsec")})
    with pytest.raises(LinearizationError, match=r"frame\.mat is in units that are none: .*'parsec'"):
        load_units(path)


@pytest.mark.parametrize("content", [b"", b"no model", b"x" * 4096, b"MATLAB 5.0 MAT-file" + b"\0" * 300])
def test_a_file_that_is_not_matlabs_is_refused(tmp_path, content):
    path = tmp_path / "notes.mat"
    path.write_bytes(content)
    with pytest.raises(LinearizationError, match=r"notes\.mat is no"):
        LinearModel.load_mat(path)
    with pytest.raises(LinearizationError, match="there is no file"):
        LinearModel.load_mat(tmp_path / "nothing.mat")
