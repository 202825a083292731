"""Writes the logs of this directory, and expected.csv: what independent readers find in them."""

import csv
import io
import struct
from datetime import datetime, timedelta
from math import cos, sin
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType
from mcap.writer import Writer as McapWriter
from mcap_ros2.reader import read_ros2_messages
from mcap_ros2.writer import Writer as Ros2Writer
from pyubx2 import GET, UBXMessage, UBXReader
from pyulog import ULog
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Bag1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Bag2
from rosbags.typesys import Stores, get_typestore

HERE = Path(__file__).parent
START_NS = 1_764_000_000_250_000_000
ROS2, ROS1 = get_typestore(Stores.ROS2_HUMBLE), get_typestore(Stores.ROS1_NOETIC)
IMU, FIX, OTHER = "sensor_msgs/msg/Imu", "sensor_msgs/msg/NavSatFix", "std_msgs/msg/String"


def motion(k):
    """Specific force (m/s²), angular rate (rad/s)."""
    return [0.3 * sin(k), -0.2 * cos(3 * k), 9.8 + 0.01 * sin(7 * k)], [0.1 * sin(k / 3), 0.02 * k / 40, -0.3 * cos(k)]


def place(k):
    return 46.5 + 1e-6 * k, 6.6 - 2e-6 * k, 400.25 + 0.1 * sin(k)


def stamped(store, ns, frame):
    time = store.types["builtin_interfaces/msg/Time"](sec=ns // 10**9, nanosec=ns % 10**9)
    header = store.types["std_msgs/msg/Header"]
    return header(seq=0, stamp=time, frame_id=frame) if store is ROS1 else header(stamp=time, frame_id=frame)


def imu(store, k, ns):
    vector = store.types["geometry_msgs/msg/Vector3"]
    accel, gyro = motion(k)
    return store.types[IMU](
        header=stamped(store, ns, "imu_link"),
        orientation=store.types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=np.zeros(9),
        angular_velocity=vector(*gyro),
        angular_velocity_covariance=np.zeros(9),
        linear_acceleration=vector(*accel),
        linear_acceleration_covariance=np.zeros(9),
    )


def fix(store, k, ns):
    lat, lon, h = place(k)
    return store.types[FIX](
        header=stamped(store, ns, "gps"),
        # the third has none
        status=store.types["sensor_msgs/msg/NavSatStatus"](status=-1 if k == 2 else 0, service=1),
        latitude=lat,
        longitude=lon,
        altitude=h,
        position_covariance=np.array([0.25, 0, 0, 0, 0.16, 0, 0, 0, 1.44]),
        position_covariance_type=2,
    )


def messages(store, count):
    """(topic, type, arrival, message): arrivals are 3 ms late, and a string stands between."""
    for k in range(count):
        ns = START_NS + k * 10_000_000
        yield "/imu", IMU, ns + 3_000_000, imu(store, k, ns)
        if k % 8 == 0:
            yield "/fix", FIX, ns + 4_000_000, fix(store, k // 8, ns)
        if k % 16 == 0:
            yield "/note", OTHER, ns + 5_000_000, store.types[OTHER](data=f"note {k}")


def plain(value):
    """A message whose arrays are lists, as mcap-ros2-support wants them."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    fields = getattr(value, "__dataclass_fields__", None)
    return SimpleNamespace(**{f: plain(getattr(value, f)) for f in fields if f[0] != "_"}) if fields else value


def mcap(name, count, order=list, **options):
    with open(HERE / name, "wb") as file:
        writer = Ros2Writer(file)
        file.seek(0)
        file.truncate()
        writer._writer = McapWriter(file, **options)
        writer._writer.start("ros2", "mcap")
        schemas = {}
        for topic, kind, ns, message in order(list(messages(ROS2, count))):
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(kind, ROS2.generate_msgdef(kind, ros_version=2)[0])
            writer.write_message(topic, schemas[kind], plain(message), log_time=ns)
        writer.finish()


def shuffled(items):
    """Each item up to 20 places from its own; the definitions come first."""
    places = np.arange(len(items)) + np.random.default_rng(1).uniform(0, 20, len(items))
    return [items[k] for k in np.argsort(places)]


def encoded(name, count, encoding, encode):
    """Messages of an encoding that mcap-ros2-support does not write."""
    store, version = (ROS1, 1) if encoding == "ros1" else (ROS2, 2)
    with open(HERE / name, "wb") as file:
        writer = McapWriter(file, compression=CompressionType.ZSTD)
        writer.start(f"ros{version}", "mcap")
        channels = {}
        for topic, kind, ns, message in messages(store, count):
            if topic not in channels:
                type_name = kind.replace("/msg", "") if version == 1 else kind
                schema = writer.register_schema(
                    type_name, f"ros{version}msg", store.generate_msgdef(kind, ros_version=version)[0].encode())
                channels[topic] = writer.register_channel(topic, encoding, schema)
            writer.add_message(channels[topic], ns, bytes(encode(message, kind)), ns)
        writer.finish()


def rosbags_mcap(name, count):
    with Bag2(HERE / "directory", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        topics = {}
        for topic, kind, ns, message in messages(ROS2, count):
            if topic not in topics:
                topics[topic] = bag.add_connection(topic, kind, typestore=ROS2)
            bag.write(topics[topic], ns, ROS2.serialize_cdr(message, kind))
    (HERE / "directory" / "directory.mcap").rename(HERE / name)
    (HERE / "directory" / "metadata.yaml").unlink()
    (HERE / "directory").rmdir()


def bag(name, count, compression, extra=(), order=list):
    (HERE / name).unlink(missing_ok=True)
    writer = Bag1(HERE / name)
    writer.chunk_threshold = 4000
    if compression:
        writer.set_compression(compression)
    with writer:
        topics = {}
        for topic, kind, ns, message in order(list(messages(ROS1, count))):
            for topic in [topic, *(extra if topic == "/imu" else ())]:
                if topic not in topics:
                    topics[topic] = writer.add_connection(topic, kind, typestore=ROS1)
                writer.write(topics[topic], ns, ROS1.serialize_ros1(message, kind))


ULOG_TOPICS = [
    ("sensor_combined", 0, "uint64_t timestamp;float[3] gyro_rad;uint32_t gyro_integral_dt;"
     "int32_t accelerometer_timestamp_relative;float[3] accelerometer_m_s2;uint32_t accelerometer_integral_dt;"),
    ("vehicle_imu", 0, "uint64_t timestamp;uint64_t timestamp_sample;uint32_t accel_device_id;uint32_t gyro_device_id;"
     "float[3] delta_angle;float[3] delta_velocity;uint32_t delta_angle_dt;uint32_t delta_velocity_dt;"
     "uint8_t[3] delta_velocity_clipping;uint8_t[5] _padding0;"),
    ("vehicle_imu", 1, None),
    ("vehicle_gps_position", 0, "uint64_t timestamp;uint64_t time_utc_usec;int32_t lat;int32_t lon;int32_t alt;"
     "int32_t alt_ellipsoid;float s_variance_m_s;float eph;float epv;float vel_n_m_s;float vel_e_m_s;float vel_d_m_s;"
     "uint8_t fix_type;bool vel_ned_valid;uint8_t[6] _padding0;"),
    ("sensor_gps", 0, "uint64_t timestamp;uint64_t timestamp_sample;double latitude_deg;double longitude_deg;"
     "double altitude_ellipsoid_m;float s_variance_m_s;float eph;float epv;float vel_n_m_s;float vel_e_m_s;"
     "float vel_d_m_s;uint8_t fix_type;bool vel_ned_valid;uint8_t[6] _padding0;"),
    ("estimator", 0, "uint64_t timestamp;inner[2] parts;float value;"),
]
SIZES = {"sensor_combined": 44, "vehicle_imu": 59, "vehicle_gps_position": 58, "sensor_gps": 66, "estimator": 28}


def ulog(name, count):
    """pyulog reads formats with one empty message each, and writes them with signals."""
    seed = io.BytesIO()
    seed.write(b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 1000))
    record = lambda kind, body: seed.write(struct.pack("<HB", len(body), ord(kind)) + body)
    record("B", bytes(40))
    record("F", b"inner:float a;uint32_t b;")
    for topic, _, fields in ULOG_TOPICS:
        if fields:
            record("F", f"{topic}:{fields}".encode())
    for number, (topic, instance, _) in enumerate(ULOG_TOPICS):
        record("A", struct.pack("<BH", instance, number) + topic.encode())
        record("D", struct.pack("<H", number) + bytes(SIZES[topic]))
    seed.seek(0)
    log = ULog(seed)
    for topic in log.data_list:
        rows = count // 4 if "gps" in topic.name else count
        k = np.arange(rows)
        data = {key: np.zeros(rows, values.dtype) for key, values in topic.data.items()}
        data["timestamp"][:] = 5_000_000 + k * 10_000 * (count // rows) + 300
        if "timestamp_sample" in data:
            data["timestamp_sample"][:] = data["timestamp"] - 200
        accel, gyro = (np.array([motion(i)[j] for i in range(rows)]) for j in (0, 1))
        for i in range(3):
            for key, values in [
                ("gyro_rad", gyro), ("accelerometer_m_s2", accel),
                ("delta_angle", gyro * 0.01), ("delta_velocity", accel * 0.01),
            ]:
                if f"{key}[{i}]" in data:
                    data[f"{key}[{i}]"][:] = values[:, i]
        lat, lon, h = np.array([place(i) for i in range(rows)]).T
        for key, values in [
            ("delta_angle_dt", 10_000), ("delta_velocity_dt", 9_990), ("gyro_integral_dt", 4_000),
            ("lat", np.round(lat * 1e7)), ("lon", np.round(lon * 1e7)), ("alt_ellipsoid", np.round(h * 1e3)),
            ("latitude_deg", lat), ("longitude_deg", lon), ("altitude_ellipsoid_m", h),
            ("eph", 0.4), ("epv", 1.2), ("s_variance_m_s", 0.15), ("fix_type", np.where(k == 2, 2, 3)),
            ("vel_n_m_s", np.sin(k)), ("vel_e_m_s", np.cos(k)), ("vel_d_m_s", 0.01 * k), ("vel_ned_valid", 1),
        ]:
            if key in data:
                data[key][:] = values
        topic.data = data
    log.write_ulog(str(HERE / name))


def ubx(name, count):
    with open(HERE / name, "wb") as file:
        for k in range(count):
            file.write(b"$GNTXT,01,01,02,between the messages*00\r\n")
            lat, lon, h = place(k)
            utc = datetime(2024, 2, 29, 23, 59, 58) + timedelta(seconds=k // 4)
            file.write(UBXMessage(
                "NAV", "NAV-PVT", GET, iTOW=200_000_000 + 250 * k, year=utc.year, month=utc.month, day=utc.day,
                hour=utc.hour, min=utc.minute, second=utc.second, validDate=1, validTime=1, fullyResolved=1, nano=250_000_000 * (k % 4) - 1_234,
                fixType=2 if k == 2 else 3, gnssFixOk=1, lon=lon, lat=lat, height=round(h * 1e3), hAcc=14, vAcc=25,
                velN=100 * k, velE=-7, velD=3 * k, sAcc=70).serialize())
            accel, gyro = motion(k)
            values = [(14, gyro[0]), (13, gyro[1]), (5, gyro[2]), (16, accel[0]), (17, accel[1]), (18, accel[2])]
            raw = [round(np.rad2deg(v) * 4096) if t < 16 else round(v * 1024) for t, v in values]
            words = [(t << 24) | (r & 0xFFFFFF) for (t, _), r in zip(values, raw)]
            # the gyroscopes and the accelerometers one after the other in every second sample
            for part in ([words] if k % 2 else [words[:3], words[3:]]):
                payload = struct.pack("<IHH", 1000 + 10 * k, len(part) << 11, 0) + struct.pack(f"<{len(part)}I", *part)
                file.write(UBXMessage("ESF", "ESF-MEAS", GET, payload=payload).serialize())


def arrays(name, save):
    accel, gyro = (np.array([motion(k)[j] for k in range(40)]) for j in (0, 1))
    times = START_NS + np.arange(40) * 10_000_000
    save(HERE / name, t_ns=times, gyro=gyro, accel=np.asfortranarray(accel.astype(">f4")), flag=np.array([True, False]),
         cube=np.asfortranarray(np.arange(24, dtype="i2").reshape(2, 3, 4)), name=np.array(["imu"]))


def row(writer, file, topic, stamps, columns):
    sums = [repr(float(np.sum(np.asarray(c, dtype=float)))) for c in columns]
    writer.writerow([file, topic, len(stamps), int(stamps[0]), int(stamps[-1]), *sums])


def read_ros(name, topic):
    """The messages by rosbags; where it refuses them by mcap: without index and not in order, or of ROS 1 in MCAP."""
    if name == "ros1.mcap":
        with open(HERE / name, "rb") as file:
            for schema, _, m in make_reader(file).iter_messages([topic]):
                yield ROS1.deserialize_ros1(m.data, schema.name.replace("/", "/msg/"))
        return
    if "unordered_unchunked" in name:
        yield from (m.ros_msg for m in read_ros2_messages(HERE / name, topics=[topic]))
        return
    with AnyReader([HERE / name], default_typestore=ROS2) as reader:
        for c, _, raw in reader.messages([c for c in reader.connections if c.topic == topic]):
            yield reader.deserialize(raw, c.msgtype)


def expect_ros(writer, name):
    for topic in ["/imu", "/fix"]:
        stamps, rows = [], []
        for m in read_ros(name, topic):
            if topic == "/fix":
                if m.status.status < 0:
                    continue
                d = [m.position_covariance[i] ** 0.5 for i in (4, 0, 8)]
                rows.append([m.latitude, m.longitude, m.altitude, *d])
            else:
                a, g = m.linear_acceleration, m.angular_velocity
                rows.append([a.x, a.y, a.z, g.x, g.y, g.z])
            stamps.append(m.header.stamp.sec * 10**9 + m.header.stamp.nanosec)
        row(writer, name, topic, stamps, np.array(rows).T)


def expect_ulog(writer, name):
    for d in ULog(str(HERE / name)).data_list:
        topic = d.name + (f".{d.multi_id}" if d.multi_id else "")
        data = {key: values.astype(float) for key, values in d.data.items()}
        stamps = d.data.get("timestamp_sample", d.data["timestamp"]) * 1000
        three = lambda key: [data[f"{key}[{i}]"] for i in range(3)]
        if d.name == "sensor_combined":
            row(writer, name, topic, stamps, three("accelerometer_m_s2") + three("gyro_rad"))
        elif d.name == "vehicle_imu":
            row(writer, name, topic, stamps,
                [v / (data["delta_velocity_dt"] / 1e6) for v in three("delta_velocity")]
                + [v / (data["delta_angle_dt"] / 1e6) for v in three("delta_angle")])
        elif "gps" in d.name:
            ok = data["fix_type"] >= 3
            if "lat" in data:
                at = [data["lat"] / 1e7, data["lon"] / 1e7, data["alt_ellipsoid"] / 1e3]
            else:
                at = [data["latitude_deg"], data["longitude_deg"], data["altitude_ellipsoid_m"]]
            sd, v = [data["eph"], data["eph"], data["epv"]], [data[f"vel_{c}_m_s"] for c in "ned"]
            row(writer, name, topic, stamps[ok], [c[ok] for c in at + sd + v + [data["s_variance_m_s"]] * 3])


def expect_ubx(writer, name):
    fixes, stamps, samples, tags, axes = [], [], [], [], {}
    with open(HERE / name, "rb") as file:
        for _, m in UBXReader(file, protfilter=2, quitonerror=0):
            if m.identity == "NAV-PVT" and m.fixType >= 3:
                at = np.datetime64(f"{m.year}-{m.month:02}-{m.day:02}T{m.hour:02}:{m.min:02}:{m.second:02}", "ns")
                stamps.append(at.astype(int) + m.nano)
                h, v, s = m.hAcc / 1e3, m.vAcc / 1e3, m.sAcc / 1e3
                fixes.append([m.lat, m.lon, m.height / 1e3, h, h, v, m.velN / 1e3, m.velE / 1e3, m.velD / 1e3, s, s, s])
            if m.identity == "ESF-MEAS":
                for i in range(1, m.numMeas + 1):
                    axes[getattr(m, f"dataType_{i:02}")] = ((getattr(m, f"dataField_{i:02}") & 0xFFFFFF) ^ 0x800000) - 0x800000
                if len(axes) == 6:
                    samples.append([axes[i] / 1024 for i in (16, 17, 18)]
                                   + [np.deg2rad(axes[i] / 4096) for i in (14, 13, 5)])
                    tags.append(m.timeTag * 10**6)
                    axes = {}
    row(writer, name, "NAV-PVT", stamps, np.array(fixes).T)
    row(writer, name, "ESF-MEAS", tags, np.array(samples).T)


def main():
    none = CompressionType.NONE
    mcap("ros2_zstd.mcap", 40, chunk_size=4000, compression=CompressionType.ZSTD)
    mcap("ros2_lz4.mcap", 40, chunk_size=4000, compression=CompressionType.LZ4)
    mcap("ros2_indexless.mcap", 12, chunk_size=2000, compression=none, index_types=IndexType.NONE,
         repeat_channels=False, repeat_schemas=False, use_statistics=False, use_summary_offsets=False)
    mcap("ros2_unchunked.mcap", 12, use_chunking=False)
    mcap("ros2_unordered.mcap", 40, order=shuffled, chunk_size=4000, compression=CompressionType.ZSTD)
    mcap("ros2_unordered_unchunked.mcap", 12, order=shuffled, use_chunking=False)
    rosbags_mcap("rosbags.mcap", 12)
    encoded("ros1.mcap", 12, "ros1", ROS1.serialize_ros1)
    encoded("big_endian.mcap", 12, "cdr", lambda m, kind: ROS2.serialize_cdr(m, kind, little_endian=False))
    bag("ros1_unordered.bag", 40, Bag1.CompressionFormat.LZ4, order=shuffled)
    bag("ros1_none.bag", 12, None)
    bag("ros1_bz2.bag", 40, Bag1.CompressionFormat.BZ2)
    bag("ros1_lz4.bag", 40, Bag1.CompressionFormat.LZ4)
    bag("ros1_two_imus.bag", 16, Bag1.CompressionFormat.BZ2, extra=["/imu_rear"])
    ulog("px4.ulg", 20)
    ubx("ublox.ubx", 9)
    arrays("arrays.npz", np.savez)
    arrays("arrays_deflated.npz", np.savez_compressed)
    with open(HERE / "expected.csv", "w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        for path in sorted(HERE.glob("*.mcap")) + sorted(HERE.glob("*.bag")):
            expect_ros(writer, path.name)
        expect_ulog(writer, "px4.ulg")
        expect_ubx(writer, "ublox.ubx")


main()
