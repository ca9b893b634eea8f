"""Sensors of any kind under links.sensors: their settings, their frames in every reader, and the links of the shell."""

from pathlib import Path

import pytest
from mcap.reader import make_reader

from asvhil.config import Config, config_from_json, find_shipped, load_config
from asvhil.config.plugins import unload_all
from asvhil.errors import ConfigError, LogError
from asvhil.logs.opening import open_recorder
from asvhil.logs.plugins import load_plugins
from asvhil.logs.reader import LogFile
from asvhil.logs.replay import replay
from asvhil.logs.run import read_run
from asvhil.simplant.lockstep import Lockstep
from asvhil.sitl import run_lockstep, run_realtime
from asvhil.train.log_series import read_log_series
from tests.support.command_line import call
from tests.support.plugins import write_line_wind

SECOND = "links.sensors.aft={kind: nmea, endpoint: 'pty:aft', declination_deg: 5.0}"


def test_a_link_has_the_keys_of_its_kind(tmp_path: Path) -> None:
    config = load_config(write_line_wind(tmp_path))
    assert config.links.sensors["mast"].model_dump() == {
        "kind": "line-wind",
        "endpoint": "serial:/dev/x:9600",
        "factor": 2.0,
    }
    again = config_from_json(config.canonical_json(), "memory")
    assert again == config and type(again.links.sensors["mast"]) is type(config.links.sensors["mast"])
    assert config.links.endpoints["mast"] == "serial:/dev/x:9600"


@pytest.mark.parametrize(
    ("override", "words"),
    [
        ("links.sensors.mast.factr=1", "key links.sensors.mast.factr: unknown key"),
        ("links.sensors.mast.factor=x", "key links.sensors.mast.factor: a number is expected, not the text 'x'"),
        ("links.sensors.mast.endpoint=x", "key links.sensors.mast.endpoint: link 'x': unknown kind"),
        ("links.sensors.mast.kind=line-wnd", "key links.sensors.mast.kind: unknown sensor, did you mean line-wind?"),
        ("links.sensors.mast.kind=null", "key links.sensors.mast.kind: text is expected, not nothing"),
        ("links.sensors={mast: 3}", "key links.sensors.mast: "),
        ("links.sensors={Mast: {kind: nmea, endpoint: 'pty:x'}}", "links.sensors.Mast"),
        ("links.sensors={ins: {kind: nmea, endpoint: 'pty:x'}}", "the name is that of a link with a key of its own"),
        ("sources.wind=[mast.WND]", "sources.wind.0: mast.WND gives no wind; of links.sensors.mast can: WIND"),
        (
            "sources.heading=[mast.WIND]",
            "sources.heading.0: mast.WIND gives no heading; of links.sensors.mast can: nothi",
        ),
        ("sources.wind=[bow.WIND]", "there is no links.sensors.bow (links with sensors: autopilot, mast)"),
    ],
)
def test_wrong_links_are_one_line_that_names_the_key(tmp_path: Path, override: str, words: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_config(write_line_wind(tmp_path), (override,))
    assert words in str(caught.value) and "\n" not in str(caught.value)


def run(config: Config, log: Path, duration_s: float = 40.0) -> None:
    run_lockstep(config, log, duration_s)


def test_the_wind_of_a_plugin_is_measured_logged_replayed_and_trained_from(tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    wind = ("plant.weather.wind.speed_mps=6", "plant.weather.wind.toward_deg=90")
    run(load_config(write_line_wind(tmp_path), wind), log)
    assert replay(log).mismatch is None
    assert len(list(LogFile(log).frames("mast", "in"))) == pytest.approx(400, abs=4)
    measured = read_run(log).wind
    assert measured[-200:, 1].mean() == pytest.approx(6.0, abs=0.6)  # the factor is on both sides of the line
    assert read_log_series(log).wind.values[:, 0].mean() == pytest.approx(6.0, abs=0.8)
    unload_all()
    words = r"log\.mcap: the run had the sensor line-wind of the plug-in wind\.py .*--plugin .*wind\.py, or"
    with pytest.raises(LogError, match=words):
        read_log_series(log)
    load_plugins([log], [tmp_path / "wind.py"])
    assert len(read_log_series(log).wind.values) == pytest.approx(400, abs=40)


@pytest.mark.parametrize(
    ("command", "options"),
    [
        pytest.param(["train", "sd"], ("--plugin", "wind.py"), marks=pytest.mark.thorough),
        (["evaluate", "nowhere.npz", "--data"], ("--allow-recorded-plugins",)),
    ],
)
def test_commands_that_decode_a_log_ask_for_the_plugin(
    tmp_path: Path, command: list[str], options: tuple[str, ...]
) -> None:
    log = tmp_path / "log.mcap"
    run(load_config(write_line_wind(tmp_path)), log)
    (tmp_path / "nowhere.npz").write_bytes(find_shipped("wamv16-sd", "models", ".npz", "model").read_bytes())
    output = ["-o", "model.npz"] if command[0] == "train" else ["--horizon", "5"]

    def said(*options: str) -> str:
        unload_all()
        return call(*command, str(log), *output, *options, cwd=tmp_path).err

    assert "the run had the sensor line-wind of the plug-in wind.py" in said()
    assert "plug-in" not in said(*options)


def test_another_sensor_takes_over_from_it(tmp_path: Path) -> None:
    config = load_config(
        write_line_wind(tmp_path),
        ("links.anemometer={endpoint: 'pty:x'}", "sources={wind: [anemometer.MWV, mast.WIND], return_after_s: 0}"),
    )
    faulty = config.model_dump(mode="json")
    faulty["plant"]["faults"] = [{"kind": "anemometer", "from_s": 6.0}]
    loop = Lockstep(Config.model_validate(faulty))
    used = [dict(loop.tick()[1].health.sources)["wind"] for _ in range(200)]
    assert used[100] == "anemometer.MWV" and used[-1] == "mast.WIND"


def test_a_second_nmea_line_is_read_as_the_first(tmp_path: Path) -> None:
    """Sources name it as any other; the simulated boat does not have it, so its sentences come from here."""
    loop = Lockstep(load_config("sitl", (SECOND, "sources.wind=[aft.MWV]")))
    for _ in range(160):
        loop.inject("aft", b"$WIMWV,090.0,R,5.00,M,A*1C\r\n")
        _, outputs = loop.tick()
    assert dict(outputs.health.sources)["wind"] == "aft.MWV" and outputs.wind is not None
    assert dict(outputs.health.counters)["aft.sentences"] == 160


def test_kinds_have_their_encoding_in_the_log(tmp_path: Path) -> None:
    config = load_config(write_line_wind(tmp_path), (SECOND,))
    recorder = open_recorder(config, tmp_path / "log.mcap", "lockstep", threaded=False)
    loop = Lockstep(config, recorder)
    for _ in range(20):
        loop.inject("aft", b"$WIMWV,090.0,R,5.00,M,A*1C\r\n")
        loop.tick()
    recorder.close()
    with (tmp_path / "log.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    encodings = {channel.topic: channel.message_encoding for channel in summary.channels.values()}
    assert encodings["/frames/aft/in"] == "nmea" and encodings["/frames/mast/in"] == "octets"


@pytest.mark.real_time
def test_the_daemon_opens_its_link(tmp_path: Path) -> None:
    """Two processes, which load the plug-in by the effective config that the run wrote."""
    config = load_config(write_line_wind(tmp_path), ("links.operator.endpoint=udpin:127.0.0.1:0",))
    log = tmp_path / "log.mcap"
    run_realtime(config, tmp_path, log, 8.0, lambda status: None)
    frames = list(LogFile(log).frames("mast", "in"))
    lines = b"".join(frame.data for frame in frames).count(b"\n")
    assert lines > 30 and read_run(log).counters["mast.lines"] == lines
