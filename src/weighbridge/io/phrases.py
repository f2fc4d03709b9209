"""What loggers call each quantity, in seven languages, and the words that tell of another."""

from __future__ import annotations

from typing import Final

PHRASES: Final[dict[str, tuple[str, ...]]] = {
    "vehicle_speed": ("v fzg", "vfzg", "v veh", "vveh", "v vehicle", "veh v", "veh spd", "spd", "veh speed", "obd 2 speed", "kmph meas", "kmph", "kph", "kmh",
        "vehicle speed", "speed", "obd speed", "speed obd", "car speed", "wheel speed", "wheel based vehicle speed",
        "ground speed can", "velocity", "geschwindigkeit", "fahrgeschwindigkeit", "fahrzeuggeschwindigkeit",
        "vitesse", "vitesse vehicule", "velocidad", "velocidad vehiculo", "velocita", "velocita veicolo",
        "velocidade", "velocidade veiculo", "snelheid", "vss", "vspeed", "speedometer", "speed sensor",
        "vehicle speed sensor", "v ego", "vego", "esp speed",
    ),
    "engine_speed": ("n eng", "neng", "n mot ist", "n em", "emot spd", "em spd", "em speed", "eng n", "eng rpm", "eng spd", "nmot", "n mot",
        "engine speed", "engine rpm", "rpm", "rpms", "engine rpms", "revs", "motor speed", "motor rpm", "motordrehzahl",
        "drehzahl", "regime moteur", "regime", "regimen motor", "revoluciones", "revoluciones motor",
        "giri motore", "giri", "regime motore", "rotacao", "rotacao motor", "toerental", "engine revolutions",
        "crankshaft speed", "n engine", "eng speed", "engine speed rpm",
    ),
    "engine_load": (
        "engine load", "calculated engine load", "calculated load value", "calculated load", "load", "motorlast",
        "berechneter lastwert", "last", "charge moteur", "charge calculee", "carga motor", "carga calculada",
        "carico motore", "carga do motor", "calc load", "engine load calculated", "calculated engine load value",
        "eng load",
    ),
    "absolute_load": ("absolute engine load", "absolute load", "absolute load value", "absolute throttle load"),
    "engine_torque": ("m mot", "m mot ist", "m em", "m em ist", "em trq", "em torque", "emot trq", "mot trq", "eng m", "trq", "eng trq", "engine trq", "eng torque",
        "engine torque", "torque", "motor torque", "drehmoment", "motordrehmoment", "couple", "couple moteur",
        "par motor", "coppia", "coppia motore", "torque motor", "actual engine torque", "net torque",
        "emotor torque", "electric motor torque", "flywheel torque",
    ),
    "engine_torque_fraction": ("m ist", "m mot ist", "actual eng percent torque", "eng percent torque",
        "actual engine percent torque", "actual engine torque", "percent torque", "engine percent torque",
        "actual engine torque percent", "engine torque", "motor torque percent", "actual torque", "torque",
        "drehmoment", "engine torque mode percent",
    ),
    "demanded_torque": ("drivers demand eng percent torque", "drivers demand engine percent torque",
        "driver s demand engine percent torque", "drivers demand engine percent torque", "demanded torque",
        "driver demand torque", "demand engine torque", "driver s demand engine torque",
    ),
    "engine_power": (
        "engine power", "motor power", "power", "leistung", "motorleistung", "puissance", "puissance moteur", "potencia",
        "potencia motor", "potenza", "potenza motore", "emotor power", "electric motor power", "drive power", "shaft power",
        "drivetrain power", "powertrain power",
    ),
    "wheel_torque": (
        "wheel torque", "torque at wheels", "total wheel torque", "radmoment", "raddrehmoment", "couple roues", "axle torque",
    ),
    "wheel_torque_front": ("wheel torque front", "front axle torque", "front wheel torque", "axle torque front"),
    "wheel_torque_rear": ("wheel torque rear", "rear axle torque", "rear wheel torque", "axle torque rear"),
    **{
        f"wheel_torque_{w}": (f"wheel torque {w}", f"{w} wheel torque", f"wheel torque {where}", f"{where} wheel torque")
        for w, where in (("fl", "front left"), ("fr", "front right"), ("rl", "rear left"), ("rr", "rear right"))
    },
    "traction_force": (
        "traction force", "tractive force", "tractive effort", "traction effort", "wheel force", "zugkraft", "driving force",
    ),
    "reference_torque": (
        "engine reference torque", "reference torque", "referenzmoment", "bezugsmoment", "m ref", "m bezug", "reference engine torque",
    ),
    "retarder_torque": ("actual retarder percent torque", "retarder percent torque", "actual retarder torque", "retarder torque", "retardermoment", "m ret", "m retarder"),
    "mass_air_flow": ("mass airflow",
        "mass air flow", "mass air flow rate", "maf", "air flow", "maf rate", "maf air flow rate", "air flow rate",
        "luftmassenstrom", "luftmasse", "debit air", "debit massique air", "flujo masa aire", "flujo aire",
        "portata aria", "massa aria", "fluxo de ar", "air flow rate maf", "intake air flow", "maf sensor",
        "air flow rate from mass flow sensor",
    ),
    "intake_pressure": ("presion absoluta colector admision", "pression absolue collecteur admission",
        "intake manifold pressure", "intake manifold absolute pressure", "manifold absolute pressure", "map",
        "manifold pressure", "saugrohrdruck", "ladedruck", "pression admission", "presion admision",
        "presion multiple admision", "pressione collettore", "intake pressure", "boost pressure absolute",
        "inlet manifold pressure",
    ),
    "throttle": (
        "throttle", "throttle position", "absolute throttle position", "tps", "throttle pos", "drosselklappe",
        "drosselklappenstellung", "position papillon", "posicion acelerador", "posicion mariposa",
        "posizione farfalla", "posicao borboleta", "throttle position manifold", "abs throttle position",
        "throttle position sensor",
    ),
    "relative_throttle": ("relative throttle position", "relative throttle"),
    "commanded_throttle": ("commanded throttle actuator", "commanded throttle", "commanded throttle actuator control"),
    "throttle_b": ("absolute throttle position b", "throttle position b", "absolute throttle b"),
    "accelerator_pedal": ("acc pedal", "aps", "accel pedal pos", "accel position", "accel actu pos",
        "accelerator pedal position", "accelerator pedal position d", "accelerator pedal", "accelerator",
        "pedal position", "gas pedal", "gaspedal", "gaspedalstellung", "fahrpedal", "fahrpedalstellung",
        "position pedale accelerateur", "pedal acelerador", "pedale acceleratore", "pedal accelerator",
        "accelerator position", "accel pedal", "accelerator pedal position 1", "app", "pedal",
        "accelerator pedalposition d", "posicion pedal acelerador", "gas",
    ),
    "relative_pedal": ("relative accelerator pedal position", "relative accelerator pedal"),
    "coolant_temperature": (
        "engine coolant temperature", "coolant temperature", "coolant temp", "engine coolant temp", "ect",
        "kuhlmitteltemperatur", "kuehlmitteltemperatur", "motorkuhlmitteltemperatur", "kuhlwassertemperatur", "temperature liquide refroidissement",
        "temperatura refrigerante", "temperatura liquido refrigerante", "temperatura acqua", "water temperature",
        "water temp", "coolant", "temperatura refrigerante motor",
    ),
    "intake_temperature": (
        "intake air temperature", "intake temperature", "intake air temp", "iat", "ansauglufttemperatur",
        "temperature air admission", "temperatura aire admision", "temperatura aria aspirata", "intake temp",
        "inlet air temperature",
    ),
    "ambient_temperature": ("ambient",
        "ambient air temperature", "ambient temperature", "ambient air temp", "ambient temp", "outside temperature",
        "oat", "aussentemperatur", "umgebungstemperatur", "temperature exterieure", "temperatura ambiente",
        "temperatura exterior", "temperatura esterna", "outside air temperature",
    ),
    "oil_temperature": ("oil celsius",
        "engine oil temperature", "oil temperature", "oil temp", "engine oil temp", "oltemperatur", "motoroltemperatur",
        "temperature huile", "temperatura aceite", "temperatura olio",
    ),
    "barometric_pressure": (
        "barometric pressure", "atmospheric pressure", "baro", "ambient pressure", "absolute barometric pressure",
        "luftdruck", "pression atmospherique", "pression barometrique", "presion barometrica", "presion atmosferica",
        "pressione barometrica", "barometer", "barometric pressure from vehicle",
    ),
    "fuel_rate": (
        "engine fuel rate", "fuel rate", "fuel flow", "fuel flow rate", "fuel consumption rate", "kraftstoffverbrauch",
        "momentanverbrauch", "debit carburant", "consumo instantaneo", "calculated instant fuel rate",
        "fuel rate direct from ecu",
    ),
    "lambda_1": ("lambda", "equivalence ratio", "air fuel equivalence ratio", "lambda 1", "o2 sensor1 equivalence ratio"),
    "commanded_lambda": ("fuel air commanded equiv ratio",
        "commanded equivalence ratio", "commanded air fuel equivalence ratio", "commanded lambda",
        "fuel air commanded equivalence ratio", "fuel air equivalence ratio commanded",
    ),
    "gear": (
        "gear", "current gear", "selected gear", "gang", "aktueller gang", "rapport", "rapport engage", "marcha",
        "marcia", "transmission gear", "gear position", "actual gear", "transmission current gear",
        "transmission estimated gear", "gear engaged", "engaged gear", "gear number", "gang ist", "ist gang",
        "rapport actuel", "marcia inserita", "marcha engranada",
    ),
    "gear_ratio": ("transmission actual gear ratio", "actual gear ratio", "gear ratio"),
    "brake_switch": ("brk sw", "brk", "brake pedal switch", "brake pedal applied", "brake applied",
        "brake switch", "brake pressed", "brake", "brake pedal", "brake pedal pressed", "brake status", "bremse", "bremspedal",
        "bremslicht", "frein", "freno", "brake light", "brake lamp switch", "stop lamp switch", "brake pedal status", "brakes", "brake lights",
    ),
    "clutch_switch": ("clutch switch", "clutch", "clutch pedal", "kupplung", "embrayage", "embrague", "frizione", "clutch pressed"),
    "battery_voltage": ("hv v",
        "battery voltage hv", "hv battery voltage", "traction battery voltage", "battery pack voltage", "pack voltage",
        "high voltage battery voltage", "hv voltage", "batteriespannung", "battery voltage",
    ),
    "battery_current": ("pack amps", "hv a",
        "battery current", "hv battery current", "traction battery current", "battery pack current", "pack current",
        "high voltage battery current", "hv current", "batteriestrom",
    ),
    "module_voltage": (
        "control module voltage", "module voltage", "ecu voltage", "obd module voltage", "supply voltage",
        "voltage control module", "adapter voltage", "obd adapter voltage", "control module voltage ecu",
    ),
    "fuel_level": ("fuel level", "fuel tank level", "fuel level input", "tankfullstand", "niveau carburant", "nivel combustible", "fuel remaining", "livello carburante"),
    "run_time": ("run time since engine start", "time since engine start", "engine run time", "engine runtime", "runtime since engine start", "tiempo desde arranque motor"),
    "odometer": ("odometer", "mileage", "kilometerstand", "total distance", "kilometrage", "vehicle odometer", "odo"),
    "latitude": ("pos lat", "latitude", "lat", "breitengrad", "breite", "latitud", "latitudine", "gps latitude", "latitude deg", "gps lat", "position latitude"),
    "longitude": ("pos lon", "pos lng", "pos long", "longitude", "lon", "lng", "long", "langengrad", "lange", "laenge", "laengengrad", "longitud", "longitudine", "gps longitude", "gps lon", "gps long", "gps lng"),
    "altitude": ("alt msl", "hgt", "altitude", "alt", "height", "elevation", "ele", "hohe", "hoehe", "altitud", "altitudine", "gps altitude", "gps alt", "gps height", "hauteur", "altura", "msl altitude", "height above msl", "location altitude", "elv"),
    "gnss_speed": ("v gnd", "vgnd", "gps kmh", "gps kph", "gps mph", "gps mps", "gps spd", "gp sspeed", "gps speed", "speed gps", "gnss speed", "speed over ground", "gps geschwindigkeit", "vitesse gps", "velocidad gps", "location speed", "gps velocity", "sog", "velocita gps", "geschwindigkeit gps"),
    "gnss_course": ("crs", "course", "heading", "bearing", "gps course", "gps bearing", "gps heading", "course over ground", "cog", "kurs", "cap", "rumbo", "track angle", "location course", "direction", "gps direction", "location bearing"),
    "hdop": ("hdop", "horizontal dilution of precision", "dop", "gps hdop"),
    "gnss_accuracy": ("horizontal accu", "accuracy", "gps accuracy", "horizontal accuracy", "genauigkeit", "precision", "location accuracy", "location horizontal accuracy", "position accuracy", "h accuracy", "gps horizontal accuracy"),
    "longitudinal_accel": ("a x veh", "ax veh", "a long", "along", "veh ax", "longitudinal acceleration", "longitudinal accel", "long accel", "langsbeschleunigung", "laengsbeschleunigung", "acceleration longitudinale", "ax vehicle", "long acceleration", "lon acceleration", "longitudinal acc", "inline acc", "inline acceleration"),
    "grade": ("grade", "road grade", "slope", "steigung", "road slope", "pente", "gradient", "pendiente", "pendenza", "inclination road"),
    **{
        f"accel_{a}": (
            f"accel {a}", f"acc {a}", f"acceleration {a}", f"accelerometer {a}", f"a {a}", f"{a} accel",
            f"{a} acceleration", f"beschleunigung {a}", f"accelerometer acceleration {a}", f"g force {a}", f"g f{a}", f"f{a}",
            f"acceleration in {a}", f"acceleration {a} with gravity", f"total acceleration {a}",
            f"aceleracion {a}", f"accelerazione {a}", f"imu accel {a}", f"linear accelerometer {a}", f"a{a}",
            f"{a} axis acceleration", f"gf {a}", f"gf{a}", f"acc{a}", f"accel{a}", f"acceleration {a} axis",
        )
        for a in "xyz"
    },
    **{
        f"gyro_{a}": (
            f"gyro {a}", f"gyroscope {a}", f"angular rate {a}", f"rotation rate {a}", f"rotation {a}", f"w {a}",
            f"{a} gyro", f"angular velocity {a}", f"drehrate {a}", f"gyr {a}", f"omega {a}", f"{a} gyroscope",
            f"gyroscope rotation {a}", f"giroscopio {a}", f"gyro rotation {a}", f"imu gyro {a}", f"w{a}",
            f"{a} rate of rotation", f"rate of rotation {a}", f"gyro{a}", f"gyr{a}", f"angular speed {a}",
            f"gyroscope {a} axis", f"{a} angular rate", f"rate {a}", f"imu rate {a}",
        )
        for a in "xyz"
    },
}  # fmt: skip
"""What loggers call each quantity: English, German, French, Spanish, Italian, Portuguese, Dutch;
without accents, in small letters."""

TIME_PHRASES: Final = frozenset(
    (
        "time", "t", "timestamp", "time stamp", "zeit", "zeitstempel", "uhrzeit", "date", "datetime", "date time",
        "device time", "gps time", "temps", "horodatage", "tiempo", "fecha hora", "hora", "tempo", "ora", "data ora", "datum",
        "elapsed", "elapsed time", "seconds elapsed", "seconds", "millis", "milliseconds", "utc", "utc time", "epoch",
        "time since start", "time utc", "unix time", "log time", "timestamps", "created at", "measured at", "sec", "ms",
        "session time", "epoch time", "interval", "meta time", "relative time", "recording time", "logging time", "time since start in ms", "running time",
        "ts", "stamp", "log mono time", "local time", "elapsed seconds", "offset", "trip time", "time elapsed", "tijd", "timestamp ms", "unix timestamp", "yyyy mo dd hh mi ss sss",
    )
)  # fmt: skip
"""What loggers call their time, likewise."""

TIME_WORDS: Final = frozenset(
    [
        "time",
        "timestamp",
        "datetime",
        "date",
        "zeit",
        "zeitstempel",
        "temps",
        "tiempo",
        "hora",
        "ts",
        "epoch",
        "stamp",
        "utc",
    ]
)
"""Words that make a name likely to be that of a time."""

AGAINST: Final[dict[str, frozenset[str]]] = {
    "vehicle_speed": frozenset(("fl", "fr", "rl", "rr", "front", "rear", "left", "right", "gps", "gnss", "engine", "motor", "wind", "fan", "limit", "cruise", "max", "min", "average", "avg",
                      "target", "accuracy", "set", "shaft", "output", "input", "turbine", "angular", "idle", "course")),
    "engine_speed": frozenset(("idle", "max", "min", "target", "wheel", "shaft", "turbo", "vehicle", "fan", "limit", "desired", "average")),
    "engine_load": frozenset(("absolute", "sensor", "cpu", "axle", "torque")),
    "engine_torque": frozenset(("steer", "eps", "reserve", "resv", "reference", "brake", "maximum", "minimum", "min", "front", "rear", "left", "right", "max", "demand", "demanded", "friction", "target", "request", "requested", "wheel", "steering", "limit", "available", "parasitic", "nominal", "converter", "retarder", "axle")),
    "engine_torque_fraction": frozenset(("steer", "eps", "reserve", "resv", "reference", "max", "demand", "demanded", "friction", "target", "request", "requested", "limit", "steering", "point", "wheel", "retarder", "nominal", "converter")),
    "engine_power": frozenset(("max", "min", "limit", "available", "charge", "charger", "charging", "battery", "heater", "ac", "steering", "window", "supply", "seat",
                               "mode", "state", "level", "demand", "demanded", "request", "requested", "target", "regen", "rated", "reference", "accessory", "hvac", "front", "rear", "ecu")),
    **{
        f"wheel_torque{ending}": frozenset(("brake", "braking", "max", "min", "limit", "demand", "demanded", "request", "requested", "target", "steering", "reference", *others))
        for ending, others in (
            ("", ("front", "rear", "left", "right", "fl", "fr", "rl", "rr")), ("_front", ("left", "right", "rear")), ("_rear", ("left", "right", "front")),
            *((f"_{w}", ()) for w in ("fl", "fr", "rl", "rr")),
        )
    },
    "retarder_torque": frozenset(("reference", "demand", "demanded", "intended", "driver", "drivers", "coolant", "mode", "speed", "point", "axle", "wheel", "engine", "brake")),
    "throttle": frozenset(("relative", "commanded", "b", "c", "pedal", "accelerator", "volts", "voltage")),
    "accelerator_pedal": frozenset(("relative", "e", "f", "brake", "clutch", "x", "y", "z")),
    "fuel_rate": frozenset(("level", "trim", "pressure", "rail", "average")),
    "gear": frozenset(("ratio", "shift", "recommended", "target", "tar", "steering", "input", "desired", "lever", "selector", "sel", "stick", "knob",
                       "mode", "reverse", "neutral", "next", "commanded", "preselected", "display", "count", "temperature", "oil", "speed", "time")),
    "brake_switch": frozenset(("pressure", "torque", "force", "parking", "temperature", "retarder", "fluid", "percent", "calculated", "regenerative", "regen")),
    "altitude": frozenset(("accuracy", "ellipsoid", "ellipsoidal", "barometric", "relative")),
    "latitude": frozenset(("accuracy", "start", "end", "std", "minutes", "seconds")),
    "longitude": frozenset(("accuracy", "start", "end", "std", "minutes", "seconds")),
    "gnss_speed": frozenset(("accuracy", "max", "average", "difference", "vs", "obd")),
    "gnss_course": frozenset(("accuracy", "magnetic", "rate", "north")),
    "gnss_accuracy": frozenset(("vertical", "speed", "bearing", "course", "heading", "altitude")),
    "intake_pressure": frozenset(("fuel", "delta", "temperature")),
    "coolant_temperature": frozenset(("requested", "oil", "intake", "gearbox", "transmission", "2", "inverter", "battery", "heater", "heatercore")),
    "battery_voltage": frozenset(("12v", "12", "cell", "min", "max", "module", "sensor", "phone", "adapter", "starter")),
    "battery_current": frozenset(("12v", "12", "max", "min", "limit", "phone", "starter", "charger")),
    "mass_air_flow": frozenset(("temperature", "voltage", "volts", "pressure", "2")),
    "lambda_1": frozenset(("commanded", "voltage", "2", "current", "target", "desired")),
    "odometer": frozenset(("trip",)),
    "oil_temperature": frozenset(("transmission", "gearbox", "axle", "differential", "atf")),
    **{f"accel_{a}": frozenset(("linear", "user", "gravity", "free", "without", "angular")) for a in "xyz"},
    **{f"gyro_{a}": frozenset(("accel", "acceleration", "uncalibrated", "vector", "bias", "drift")) for a in "xyz"},
}  # fmt: skip
"""Words with which a name means something else."""
