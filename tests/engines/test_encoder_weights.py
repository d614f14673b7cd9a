from urllib.error import URLError

import pytest
import torch
from safetensors.torch import save_file

from aug3d_core.heads.pixelnerf import encoder_weights
from aug3d_core.heads.pixelnerf.encoder_weights import start_trunk
from aug3d_core.heads.pixelnerf.resnet import ResNet34
from aug3d_core.run.errors import InputError


@pytest.fixture(scope="module")
def whole():
    """A file of weights as torchvision writes it, with the parts that are not used."""
    torch.manual_seed(1)
    rest = {"layer4.0.conv1.weight": torch.zeros(2), "fc.weight": torch.zeros(3), "fc.bias": torch.zeros(1)}
    return {**ResNet34().state_dict(), **rest}


def same(trunk, weights):
    return all(torch.equal(value, weights[name]) for name, value in trunk.state_dict().items())


@pytest.mark.parametrize("name", ["resnet34.pth", "resnet34.safetensors"])
def test_a_file_of_torchvisions_weights_fits(whole, tmp_path, name):
    (torch.save if name.endswith("pth") else save_file)(whole, tmp_path / name)
    trunk = ResNet34()
    assert start_trunk(trunk, str(tmp_path / name)) == str(tmp_path / name)
    assert same(trunk, whole)


def test_random_weights_stay_as_they_are():
    trunk = ResNet34()
    before = {name: value.clone() for name, value in trunk.state_dict().items()}
    assert start_trunk(trunk, "random") == "random"
    assert same(trunk, before)


def test_weights_in_torchs_cache_are_taken_without_a_network(whole, tmp_path, monkeypatch):
    monkeypatch.setenv("TORCH_HOME", str(tmp_path))
    (tmp_path / "hub" / "checkpoints").mkdir(parents=True)
    torch.save(whole, tmp_path / "hub" / "checkpoints" / "resnet34-b627a593.pth")
    trunk = ResNet34()
    assert start_trunk(trunk, "auto") == "ImageNet"
    assert same(trunk, whole)


def test_without_cache_and_network_the_weights_are_random_and_it_is_said(tmp_path, monkeypatch):
    def no_network(*_, **__):
        raise URLError("no network")

    monkeypatch.setenv("TORCH_HOME", str(tmp_path))
    monkeypatch.setattr(torch.hub, "load_state_dict_from_url", no_network)
    assert start_trunk(ResNet34(), "auto").startswith("random, for ImageNet's weights are not at hand")


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(InputError, match=r"gone\.pth is no file"):
        start_trunk(ResNet34(), str(tmp_path / "gone.pth"))


@pytest.mark.parametrize("name", ["cut.pth", "cut.safetensors"])
def test_a_damaged_file_is_named(tmp_path, name):
    (tmp_path / name).write_bytes(b"PK\x03\x04 not much")
    with pytest.raises(InputError, match=f"{name} is damaged"):
        start_trunk(ResNet34(), str(tmp_path / name))


def test_weights_of_another_network_are_refused(whole, tmp_path):
    save_file({name: value for name, value in whole.items() if name != "conv1.weight"}, tmp_path / "less.safetensors")
    with pytest.raises(InputError, match=r"another network: Missing key.*conv1\.weight"):
        start_trunk(ResNet34(), str(tmp_path / "less.safetensors"))


class Bomb:
    def __reduce__(self):
        return print, ("boom",)


def test_a_file_with_code_is_refused_without_running_it(tmp_path, capsys):
    torch.save({"conv1.weight": Bomb()}, tmp_path / "bomb.pth")
    with pytest.raises(InputError, match=r"bomb\.pth is damaged"):
        start_trunk(ResNet34(), str(tmp_path / "bomb.pth"))
    assert "boom" not in capsys.readouterr().out


def test_patience_is_put_back():
    before = encoder_weights.socket.getdefaulttimeout()
    with encoder_weights._impatient():
        assert encoder_weights.socket.getdefaulttimeout() == 20.0
    assert encoder_weights.socket.getdefaulttimeout() == before
