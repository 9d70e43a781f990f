"""Which names and numbers of classes are vehicles."""

import pickle
import types

import groundpose as gp
import numpy as np
import pytest
import stand_in
from groundpose.demo import example
from groundpose.formats.boxes import Box
from groundpose.keypoints.pipeline import Pipeline
from groundpose.vehicles import CLASSES
from groundpose.vehicles.words import NO_CLASS, WORDS, class_names, first_number, numbered_name, vehicle_class

VEHICLES = {
    "car": "car Car vehicle.car sedan Pkw voiture taxi police_car object--vehicle--car VanSUV parked-car "
    "auto 轿车",
    "van_bus": "van Bus vehicle.bus.rigid vehicle/bus/bendy school_bus coach minibus Lieferwagen "
    "ambulance van_bus",
    "pickup": "pickup pick-up Pickup_Truck vehicle.pickup",
    "box_truck": "truck lorry LKW heavyTruck box_truck vehicle.truck camión Semi-truck BOX_TRUCK trucks",
    "vehicle": "vehicle vehicle.construction TYPE_VEHICLE vehicle.emergency.police trailer REGULAR_VEHICLE "
    "caravan Other_Vehicle_-_Uncommon Anhänger",
    NO_CLASS: "person Pedestrian human.pedestrian.adult Cyclist vehicle.bicycle vehicle.motorcycle rider "
    "bus_stop car_door traffic_light DontCare Misc train Tram object--vehicle--on-rails "
    "person_on_vehicle cable_car class_4 non_motorized_vehicle static.vegetation ego_vehicle "
    "toy_car autorickshaw carpet scar busy",
}


@pytest.mark.parametrize(("name", "meant"), [(n, c) for c, names in VEHICLES.items() for n in names.split()])
def test_usual_words(name, meant):
    assert vehicle_class(name) == meant


@pytest.mark.parametrize("name", ["heavy truck", "Heavy Truck", "vehicle.truck", "Tow truck", "fire-truck"])
def test_words_apart(name):
    assert vehicle_class(name) == "box_truck"


def test_every_word_means_a_class():
    assert set(WORDS.values()) == {*CLASSES, "vehicle"}
    assert vehicle_class("") == "vehicle"  # a box without a name


def test_names_of_a_caller_win():
    classes = class_names({"Kombi-Taxi": "car", "bus": "none", "9": "box_truck"})
    assert vehicle_class("kombi taxi", classes) == "car"
    assert vehicle_class("bus", classes) == NO_CLASS
    assert Box((0.0, 0.0, 1.0, 1.0), 0, "class 9", class_id=9).means_vehicle(classes)
    assert not Box((0.0, 0.0, 1.0, 1.0), 0, "class 9", class_id=9).is_vehicle
    with pytest.raises(gp.InputError, match=r"classes: expected NAME=CLASS .*car, van_bus.*, got bus=coach"):
        class_names({"bus": "coach"})


def test_numbers():
    assert [numbered_name(k) for k in (0, 2, 5, 7, 80)] == ["person", "car", "bus", "truck", "class 80"]
    assert [numbered_name(k, 1) for k in (0, 1, 3, 6, 8)] == ["class 0", "person", "car", "bus", "truck"]
    assert [first_number(ids) for ids in ([], [0], [2, 5], [2], [1, 2, 5], [3, 5, 7])] == [1, 0, 0, 1, 1, 1]


@pytest.fixture(scope="module")
def pipeline(tmp_path_factory) -> Pipeline:
    return Pipeline(stand_in.write(tmp_path_factory.mktemp("network") / "any.onnx"), threads=1)


BOXES = np.array([[885.9, 497.7, 1115.4, 734.0], [200.0, 500.0, 260.0, 640.0]])


def detections(**more: object) -> types.SimpleNamespace:
    return types.SimpleNamespace(
        xyxy=BOXES, confidence=np.array([0.9, 0.8]), class_id=np.array([5, 0]), **more
    )


GIVEN = {
    "names": detections(data={"class_name": np.array(["bus", "person"])}),
    "numbers": detections(data={}),
    "torchvision": {"boxes": BOXES, "labels": np.array([6, 1])},
    "an array": np.column_stack([BOXES, [0.9, 0.8], [5, 0]]),
    "rows": np.column_stack([BOXES, [0.9, 0.8], [5, 0]]).tolist(),
}


@pytest.mark.parametrize("kind", GIVEN)
def test_a_person_never_becomes_a_car(kind, pipeline):
    street = example()
    poses = pipeline(street.image, GIVEN[kind], street.view)
    assert poses.status[1] == "not_a_vehicle"
    assert poses.classes.tolist() == ["car", ""]
    assert np.isnan(poses.t[1]).all()
    alone = pipeline(street.image, BOXES[:1], street.view)
    np.testing.assert_array_equal(poses.t[0], alone.t[0])


def test_tracks_are_kept_and_classes_can_be_said(pipeline, tmp_path):
    street = example()
    given = detections(data={"class_name": np.array(["bus", "person"])}, tracker_id=np.array([17, 18]))
    assert pipeline(street.image, given, street.view).ids.tolist() == [17, 18]
    assert pipeline(street.image, BOXES, street.view).ids.tolist() == [0, 1]
    own = Pipeline(pipeline.network, threads=1, classes={"person": "car", "5": "none"})
    assert own(street.image, given, street.view).classes.tolist() == ["", "car"]
    with pytest.raises(gp.InputError, match="classes: expected"):
        Pipeline(pipeline.network, classes={"person": "human"})


def test_a_pipeline_goes_to_other_processes(pipeline):
    street = example()
    own = Pipeline(pipeline.network, threads=1, classes={"tram": "van_bus"})
    again = pickle.loads(pickle.dumps(own))
    assert (again.classes, again.network.path) == (own.classes, own.network.path)
    a, b = (p(street.image, street.bboxes, street.view) for p in (own, again))
    np.testing.assert_array_equal(a.t, b.t)


def test_files_are_boxes_in_pixels_of_the_image(pipeline, tmp_path):
    street = example()
    path = tmp_path / "street.txt"
    path.write_text("5 0.5 0.5 0.1 0.2\n")
    poses = pipeline(street.image, path, street.view)
    np.testing.assert_allclose(poses.bboxes, [[0.45 * 1914, 0.4 * 1080, 0.55 * 1914, 0.6 * 1080]])
