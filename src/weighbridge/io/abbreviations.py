"""Shortened words of signal names, and words that say nothing of a quantity or report another."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

_SHORT: Final[dict[str, tuple[str, ...]]] = {
    "speed": ("spd", "spds", "velocity", "vel"),
    "torque": ("trq", "tq", "toq", "torq", "trqe"),
    "vehicle": ("veh", "vhcl", "vehcl"),
    "engine": ("eng", "engn"),
    "motor": ("mot", "mtr"),
    "emotor": ("emot",),
    "wheel": ("whl", "whls"),
    "brake": ("brk", "brks"),
    "pedal": ("pdl", "pedl", "ped"),
    "accel": ("accl", "accelr", "accr", "acel"),
    "position": ("pos", "posn", "psn", "pstn"),
    "switch": ("sw", "swt", "swtch"),
    "temperature": ("temp", "tmp", "tempr"),
    "ambient": ("amb", "ambt", "ambnt"),
    "coolant": ("clnt", "coolnt"),
    "current": ("cur", "curr", "crnt", "amps"),
    "voltage": ("volt", "volts", "vltg"),
    "power": ("pwr",),
    "battery": ("batt", "bat", "batry"),
    "pressure": ("pres", "prs", "press"),
    "throttle": ("thr", "thrtl", "throt"),
    "reference": ("ref", "refr"),
    "transmission": ("trns", "trans", "tr", "tx", "gbx", "gearbox", "getriebe"),
    "heading": ("hdg", "hdng"),
    "gear": ("gr",),
    "longitudinal": ("longi", "longt", "longit", "lgt"),
    "acceleration": ("acceln", "accn"),
    "beschleunigung": ("beschl",),
    "geschwindigkeit": ("geschw",),
    "applied": ("appd", "appl"),
    "estimated": ("est", "estd", "estmd", "estimate"),
    "angular": ("ang",),
    "rpm": ("revs",),
    "percent": (
        "pct",
        "perc",
        "porcentaje",
        "pourcentage",
        "percentuale",
        "percentual",
        "prozent",
        "procent",
        "процент",
        "百分比",
    ),
    "load": ("ld",),
    "calculated": ("cal", "calc", "calculate"),
    "parking": ("prk", "park"),
    "gps": ("gnss",),
    "elevation": ("elev",),
}

LONG: Final = {short: word for word, shorts in _SHORT.items() for short in shorts}
"""Words by their shortened spelling."""

SOURCES: Final = frozenset(
    (
        "imu", "vcu", "inv", "inverter", "mcu", "pcu", "hvc", "bms", "esp", "esc", "tcu", "tcm",
        "ecm", "pcm", "egs", "dme", "ins", "sg", "sig", "hsc", "act", "actl", "actual", "phys",
        "measured", "meas", "feedback", "fbk", "fdbk", "fb", "detected", "estimated", "istwert",
        "ist", "reel", "sae", "aktuell", "aktuelle", "aktueller", "aktuelles", "aktuellt",
        "actuel", "actuelle",
        "attuale", "atual", "aktualny", "aktualni", "текущии", "текущая", "实际", "当前",
    )
)  # fmt: skip
"""Prefixes and endings that name who sends a signal, or that it is measured."""

OF_ANOTHER: Final = frozenset(
    (
        "req", "rq", "rqst", "rqd", "request", "requested", "cmd", "command", "trg", "trgt", "tgt",
        "target", "setpoint", "lim", "limit", "max", "mx", "maximum", "mn", "minimum", "des",
        "desired", "dmd", "valid", "vld", "vldy", "validity", "qf", "quality", "sts", "stat",
        "status", "state", "flt", "falt", "fault", "err", "error", "cnt", "counter", "crc", "chksm",
        "checksum", "alv", "alive", "diag", "warn", "warning", "lamp", "avail", "offset", "std",
        "sigma", "rolling", "source", "specified", "setpoint", "sp", "aim", "predicted",
        "expected", "average", "avg", "mean", "derivative", "dot", "delta", "correction", "corr",
        "cor", "trim", "adder", "limiter", "previous", "next", "blip",
        "soll", "sollwert", "ziel", "durchschnitt", "mittelwert", "fehler",
        "consigne", "cible", "moyenne", "moyen", "maxi", "defaut",
        "objetivo", "consigna", "deseado", "deseada", "promedio", "maxima", "maximo", "minima",
        "obiettivo", "richiesta", "richiesto", "massima", "massimo",
        "gewenst", "gewenste", "gemiddeld", "gemiddelde", "doel", "fout",
        "zadana", "zadany", "zadane", "srednia", "srednie", "maksymalna", "maksymalny", "blad",
        "onskad", "onskat", "borvarde", "medel", "begard", "begart", "fel",
        "pozadovany", "pozadovana", "pozadovane", "prumerna", "prumerny", "maximalni", "chyba",
        "hedef", "istenen", "ortalama", "azami", "hata",
        "media", "medio", "solicitado", "solicitada", "alvo", "demandado", "demandada", "pedido",
        "erro",
        "demande", "demandee", "vise", "visee",
        "средняя", "средний", "среднее", "макс", "максимальная", "максимальный", "мин",
        "минимальная",
        "заданная", "заданный", "целевая", "целевой", "требуемый", "запрошенный", "ошибка",
        "коррекция",
        "ограничение", "лимит",
        "平均", "目标", "目標", "设定", "請求", "请求", "需求", "指令", "期望", "最大", "最小",
        "最高", "最低", "限速", "限制",
        "故障", "状态", "单体", "要求", "単体",
        "목표", "요구", "명령", "최대", "최소", "평균", "최고", "최저", "고장", "상태",
    )
)  # fmt: skip
"""Words of a request, a bound, an average, a check or a state of a signal, in place of the signal;
English, German, French, Spanish, Italian, Portuguese, Dutch, Polish, Swedish, Czech, Turkish,
Russian, Chinese, Japanese, Korean."""


def spelled(words: Iterable[str]) -> tuple[str, ...]:
    """Spell shortened words out."""
    return tuple(LONG.get(word, word) for word in words)
