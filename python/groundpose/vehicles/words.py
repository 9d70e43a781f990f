"""What tools call vehicles: one table of usual words, and the numbers of COCO's classes."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection, Mapping

from groundpose._checks import input_error
from groundpose.vehicles.classes import CLASSES

ANY_CLASS = "vehicle"
"""A vehicle of whatever class."""
NO_CLASS = "none"
"""No vehicle."""

_WORDS = {
    "car": "car cars automobile auto autos sedan saloon hatchback coupe suv jeep taxi cab limousine "
    "convertible roadster wagon minivan mpv crossover pkw kombi personenauto voiture berline coche carro "
    "turismo automovil 汽车 轿车 小汽车 乗用車",
    "van_bus": "van vans bus buses minibus coach coaches omnibus camper motorhome campervan ambulance "
    "transporter lieferwagen kleinbus reisebus wohnmobil camionnette fourgon autobus autocar furgoneta "
    "furgone bestelwagen bestelbus 公交车 面包车 客车 バス",
    "pickup": "pickup pickups ute 皮卡",
    "box_truck": "truck trucks lorry lorries lkw lastwagen laster sattelzug camion semi tractortrailer "
    "vrachtwagen firetruck 卡车 货车 トラック",
    ANY_CLASS: "vehicle vehicles trailer trailers caravan caravans anhanger auflieger fahrzeug vehicule "
    "vehiculo veicolo voertuig motorvehicle remolque remorque",
}
WORDS: dict[str, str] = {word: name for name, words in _WORDS.items() for word in words.split()}
"""The class that each word means."""

_OTHERS = {
    "qualifiers": "rigid bendy articulated police emergency construction moving parked stopped front rear "
    "back side left right small medium large big heavy light uncommon other fallback official",
    "no vehicles": "person people pedestrian human rider driver cyclist motorcyclist bicyclist adult child "
    "man woman bicycle bike bikes motorcycle motorcycles motorbike motorbikes moped scooter cycle tricycle "
    "rickshaw autorickshaw tram train trains rail rails railed boat ship airplane aeroplane plane wheelchair "
    "wheeled non motorized stroller animal toy cable ego dontcare dont ignore ignored stop lane sign wheel "
    "door plate tire",
}
_QUALIFIERS = frozenset(_OTHERS["qualifiers"].split())
"""Words that may follow a vehicle's: `vehicle.bus.bendy`, `car_rear`."""
_NO_VEHICLES = frozenset(_OTHERS["no vehicles"].split())
"""A name with one of these is none of a vehicle, whatever else is in it (`vehicle.bicycle`, `bus stop`)."""

_ROAD_USERS = ("person", "bicycle", "car", "motorcycle", "airplane", "bus", "train", "truck", "boat")
"""COCO's first classes: from 0 as detectors number them, from 1 as COCO does."""
_DETECTORS, _COCO = 0, 1


def vehicle_class(name: str, more: Mapping[str, str] | None = None) -> str:
    """The class of vehicle that a name means, `ANY_CLASS` for one without, `NO_CLASS` for no vehicle.

    Args:
        name: as a detector or a labelling tool has it, in any case and with any separators; "" is a vehicle.
        more: names (or numbers of classes) that mean a class of ours, `ANY_CLASS` or `NO_CLASS`; they win.
    """
    key = plain(name)
    for given, meant in (more or {}).items():
        if plain(given) == key:
            return meant
    if not name:
        return ANY_CLASS
    words = key.replace("pick up", "pickup").split()
    if not words or set(words) & _NO_VEHICLES:
        return NO_CLASS
    while len(words) > 1 and (words[-1] in _QUALIFIERS or words[-1].isdigit()):
        words.pop()
    found = WORDS.get(words[-1], NO_CLASS)
    if found == "box_truck" and words[0] == "pickup":
        return "pickup"
    return "van_bus" if words[-2:] == ["van", "bus"] else found


def plain(name: str) -> str:
    """A name in lower case, words apart, without accents: `heavyTruck`, `Heavy-truck` are `heavy truck`."""
    apart = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name)
    letters = unicodedata.normalize("NFKD", apart)
    bare = "".join(c for c in letters if not unicodedata.combining(c)).casefold()
    return " ".join(re.sub(r"[\W_]+", " ", bare).split())


def class_names(given: Mapping[str, str], argument: str = "classes") -> dict[str, str]:
    """Checked names of a caller. Raises InputError for a class that is none."""
    known = (*CLASSES, ANY_CLASS, NO_CLASS)
    for name, meant in given.items():
        if meant not in known:
            raise input_error(argument, f"NAME=CLASS with a class of {', '.join(known)}", f"{name}={meant}")
    return dict(given)


def numbered_name(number: int, first: int = _DETECTORS) -> str:
    """What COCO calls a class that has only a number, of the road users; else "class N".

    `first`: 0 as detectors count, 1 as COCO's own files do.
    """
    at = number - first
    return _ROAD_USERS[at] if 0 <= at < len(_ROAD_USERS) else f"class {number}"


def first_number(numbers: Collection[int]) -> int:
    """From where results with COCO's form count their classes: 1 as COCO does, unless they cannot.

    0 is no class of COCO's own. Detectors' car, bus, truck (2, 5, 7) would be bicycle, airplane and train:
    two of these together without a person (1), a car, bus or truck (3, 6, 8) are taken for what detectors
    mean.
    """
    found = set(numbers)
    theirs = len(found & {2, 5, 7}) >= 2 and not found & {1, 3, 6, 8}
    return _DETECTORS if 0 in found or theirs else _COCO
