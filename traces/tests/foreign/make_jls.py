"""Makes the JLS files of this folder and the tables beside them: `python make_jls.py FOLDER`, with pyjls 0.17."""
import os
import sys
import numpy as np
from pyjls import DataType, Reader, SignalType, Writer

FOLDER = sys.argv[1]


def path(name):
    return os.path.join(FOLDER, name)


def recorded(samples, seed):
    rng = np.random.default_rng(seed)
    current = (0.5 + 0.2 * rng.standard_normal(samples)).astype(np.float32)
    voltage = (5 + 0.01 * rng.standard_normal(samples)).astype(np.float32)
    return voltage, current


def table(name, header, *columns):
    with open(path(name), "w") as file:
        file.write(header + "\n")
        for row in zip(*columns):
            file.write(",".join(str(value) for value in row) + "\n")


def signals(writer, rate_hz, *, source=1, first=1, of):
    for number, (name, unit, kind) in enumerate(of):
        writer.signal_def(
            first + number, source, SignalType.FSR, kind, rate_hz, samples_per_data=160,
            sample_decimate_factor=16, entries_per_summary=20, summary_decimate_factor=10, name=name, units=unit,
        )


def instrument():
    """As a JS220 records: three signals in step, numbered from 1000 on, others beside them."""
    voltage, current = recorded(3003, 1)
    power = voltage * current
    with Writer(path("pyjls.jls")) as writer:
        writer.source_def(1, "JS220-000001", "Jetperch", "JS220", "1.2.3", "000001")
        signals(writer, 100_000, first=3, of=[
            ("current", "A", DataType.F32), ("voltage", "V", DataType.F32), ("power", "W", DataType.F32),
            ("current range", "", DataType.U8)])
        writer.user_data(0x123, "a note")
        at, turn = 0, 0
        while at < 3003:
            count = min([700, 311, 1024][turn % 3], 3003 - at)
            for number, values in (3, current), (4, voltage), (5, power), (6, np.full(3003, 2, np.uint8)):
                writer.fsr(number, 1000 + at, values[at : at + count])
            at, turn = at + count, turn + 1
        for number in 3, 4, 5:
            writer.utc(number, 1000, 1 << 50)
            writer.utc(number, 4002, (1 << 50) + (1 << 25))
        writer.annotation(3, 1200, 0.5, 1, 0, "mark")
    table("pyjls.csv", "voltage_V,current_A", voltage, current)


def types():
    """Two sources, other units and types."""
    rng = np.random.default_rng(2)
    voltage = 5000 + rng.standard_normal(500)
    current = rng.integers(-30_000, 30_000, 500).astype(np.int16)
    power = rng.standard_normal(500).astype(np.float32)
    with Writer(path("pyjls_types.jls")) as writer:
        writer.source_def(1, "left", "", "", "", "")
        writer.source_def(2, "right", "", "", "", "")
        signals(writer, 2000, of=[("voltage", "mV", DataType.F64), ("current", "mA", DataType.I16)])
        signals(writer, 2000, source=2, first=8, of=[("power", "W", DataType.F32), ("current", "A", DataType.U4)])
        for number, values in (1, voltage), (2, current), (8, power):
            writer.fsr(number, 0, values)
    table("pyjls_types.csv", "left_voltage_mV,left_current_mA,right_power_W", voltage.astype(np.float32), current, power)


def gaps():
    """Samples 500 to 599 lost, which pyjls writes as NaN, and a constant signal whose chunks are left out."""
    voltage, current = recorded(1000, 3)
    with Writer(path("pyjls_gaps.jls")) as writer:
        writer.source_def(1, "JS220", "", "", "", "")
        signals(writer, 1000, of=[
            ("current", "A", DataType.F32), ("voltage", "V", DataType.F32), ("spare voltage", "V", DataType.U8)])
        writer.fsr_omit_data(3, 0)  # 0 turns it on: the binding of 0.17 inverts its argument
        for number, values in (1, current), (2, voltage), (3, np.full(1000, 5, np.uint8)):
            writer.fsr(number, 0, values[:500])
            writer.fsr(number, 600 if number < 3 else 500, values[600 if number < 3 else 500 :])


def rates():
    """Signals that make up no rows: another rate, another length."""
    voltage, current = recorded(400, 4)
    with Writer(path("pyjls_rates.jls")) as writer:
        writer.source_def(1, "JS220", "", "", "", "")
        signals(writer, 1000, of=[("current", "A", DataType.F32)])
        signals(writer, 500, first=2, of=[("voltage", "V", DataType.F32)])
        signals(writer, 1000, first=3, of=[("short voltage", "V", DataType.F32), ("late voltage", "V", DataType.F32)])
        for number, start, count in (1, 0, 400), (2, 0, 200), (3, 0, 399), (4, 1, 400):
            writer.fsr(number, start, voltage[:count])


def unclosed():
    """What a recorder that was ended leaves."""
    if os.fork() == 0:
        voltage, current = recorded(400, 5)
        writer = Writer(path("pyjls_unclosed.jls"))
        writer.source_def(1, "JS220", "", "", "", "")
        signals(writer, 1000, of=[("current", "A", DataType.F32), ("voltage", "V", DataType.F32)])
        for number, values in (1, current), (2, voltage):
            writer.fsr(number, 0, values)
        writer.flush()
        os._exit(0)
    os.wait()


def repaired():
    """The instrument's recording cut off, then repaired by opening it: lists still lead to where the next chunks were."""
    with open(path("pyjls.jls"), "rb") as file:
        whole = file.read()
    for length in 19_000, 44_500:
        with open(path(f"pyjls_repaired_{length}.jls"), "wb") as file:
            file.write(whole[:length])
        with Reader(path(f"pyjls_repaired_{length}.jls")) as reader:
            assert reader.signals[3].length > reader.signals[4].length


instrument()
types()
gaps()
rates()
unclosed()
repaired()
for name in os.listdir(FOLDER):
    os.chmod(path(name), 0o644)
