@0xd5b1c7e29a4f3e61;
# The parts of openpilot's logs that a drive needs. Numbers and types are those of the published
# schema (commaai/cereal, log.capnp and car.capnp): where a field lies hangs on all before it, so
# those that are not needed stand here without a name.

struct Event {
  logMonoTime @0 :UInt64;  # [ns]
  valid @67 :Bool = true;
  union {
    other1 @1 :AnyPointer;
    other2 @2 :AnyPointer;
    other3 @3 :AnyPointer;
    other4 @4 :AnyPointer;
    can @5 :List(CanData);
    other6 @6 :AnyPointer;
    other7 @7 :AnyPointer;
    other8 @8 :AnyPointer;
    other9 @9 :AnyPointer;
    other10 @10 :AnyPointer;
    sensorEventsDEPRECATED @11 :List(SensorEventData);
    other12 @12 :AnyPointer;
    other13 @13 :AnyPointer;
    other14 @14 :AnyPointer;
    other15 @15 :AnyPointer;
    other16 @16 :AnyPointer;
    other17 @17 :AnyPointer;
    other18 @18 :AnyPointer;
    other19 @19 :AnyPointer;
    other20 @20 :AnyPointer;
    gpsLocation @21 :GpsLocationData;
    carState @22 :CarState;
    other23 @23 :AnyPointer;
    other24 @24 :AnyPointer;
    other25 @25 :AnyPointer;
    other26 @26 :AnyPointer;
    other27 @27 :AnyPointer;
    other28 @28 :AnyPointer;
    other29 @29 :AnyPointer;
    other30 @30 :AnyPointer;
    other31 @31 :AnyPointer;
    other32 @32 :AnyPointer;
    other33 @33 :AnyPointer;
    other34 @34 :AnyPointer;
    other35 @35 :AnyPointer;
    other36 @36 :AnyPointer;
    other37 @37 :AnyPointer;
    other38 @38 :AnyPointer;
    other39 @39 :AnyPointer;
    other40 @40 :AnyPointer;
    other41 @41 :AnyPointer;
    other42 @42 :AnyPointer;
    other43 @43 :AnyPointer;
    other44 @44 :AnyPointer;
    other45 @45 :AnyPointer;
    other46 @46 :AnyPointer;
    other47 @47 :AnyPointer;
    gpsLocationExternal @48 :GpsLocationData;
    other49 @49 :AnyPointer;
    other50 @50 :AnyPointer;
    other51 @51 :AnyPointer;
    other52 @52 :AnyPointer;
    other53 @53 :AnyPointer;
    other54 @54 :AnyPointer;
    other55 @55 :AnyPointer;
    other56 @56 :AnyPointer;
    other57 @57 :AnyPointer;
    other58 @58 :AnyPointer;
    other59 @59 :AnyPointer;
    other60 @60 :AnyPointer;
    other61 @61 :AnyPointer;
    other62 @62 :AnyPointer;
    other63 @63 :AnyPointer;
    other64 @64 :AnyPointer;
    other65 @65 :AnyPointer;
    other66 @66 :AnyPointer;
    other68 @68 :AnyPointer;
    other69 @69 :AnyPointer;
    other70 @70 :AnyPointer;
    other71 @71 :AnyPointer;
    other72 @72 :AnyPointer;
    other73 @73 :AnyPointer;
    other74 @74 :AnyPointer;
    other75 @75 :AnyPointer;
    other76 @76 :AnyPointer;
    other77 @77 :AnyPointer;
    other78 @78 :AnyPointer;
    other79 @79 :AnyPointer;
    other80 @80 :AnyPointer;
    other81 @81 :AnyPointer;
    other82 @82 :AnyPointer;
    other83 @83 :AnyPointer;
    other84 @84 :AnyPointer;
    other85 @85 :AnyPointer;
    other86 @86 :AnyPointer;
    other87 @87 :AnyPointer;
    other88 @88 :AnyPointer;
    other89 @89 :AnyPointer;
    other90 @90 :AnyPointer;
    other91 @91 :AnyPointer;
    other92 @92 :AnyPointer;
    other93 @93 :AnyPointer;
    other94 @94 :AnyPointer;
    other95 @95 :AnyPointer;
    other96 @96 :AnyPointer;
    other97 @97 :AnyPointer;
    accelerometer @98 :SensorEventData;
    gyroscope @99 :SensorEventData;
    other100 @100 :AnyPointer;
    other101 @101 :AnyPointer;
    other102 @102 :AnyPointer;
    other103 @103 :AnyPointer;
    other104 @104 :AnyPointer;
    other105 @105 :AnyPointer;
    other106 @106 :AnyPointer;
    other107 @107 :AnyPointer;
    other108 @108 :AnyPointer;
    other109 @109 :AnyPointer;
    other110 @110 :AnyPointer;
    other111 @111 :AnyPointer;
    other112 @112 :AnyPointer;
    other113 @113 :AnyPointer;
    other114 @114 :AnyPointer;
    other115 @115 :AnyPointer;
    other116 @116 :AnyPointer;
    other117 @117 :AnyPointer;
    other118 @118 :AnyPointer;
    other119 @119 :AnyPointer;
    other120 @120 :AnyPointer;
    other121 @121 :AnyPointer;
    other122 @122 :AnyPointer;
    other123 @123 :AnyPointer;
    other124 @124 :AnyPointer;
    other125 @125 :AnyPointer;
    other126 @126 :AnyPointer;
    other127 @127 :AnyPointer;
  }
}

struct CanData {
  address @0 :UInt32;
  busTime @1 :UInt16;
  dat @2 :Data;
  src @3 :UInt8;
}

struct SensorVec {
  v @0 :List(Float32);
  status @1 :Int8;
}

struct SensorEventData {
  version @0 :Int32;
  sensor @1 :Int32;
  type @2 :Int32;
  timestamp @3 :Int64;  # [ns]
  uncalibrated @10 :Bool;
  union {
    acceleration @4 :SensorVec;  # [m/s^2]
    magnetic @5 :SensorVec;
    orientation @6 :SensorVec;
    gyro @7 :SensorVec;  # [rad/s]
    pressure @9 :SensorVec;
    magneticUncalibrated @11 :SensorVec;
    gyroUncalibrated @12 :SensorVec;  # [rad/s]
    proximity @13 :Float32;
    light @14 :Float32;
    temperature @15 :Float32;
  }
  source @8 :UInt16;
}

struct GpsLocationData {
  flags @0 :UInt16;
  latitude @1 :Float64;  # [deg]
  longitude @2 :Float64;  # [deg]
  altitude @3 :Float64;  # [m]
  speed @4 :Float32;  # [m/s]
  bearingDeg @5 :Float32;
  horizontalAccuracy @6 :Float32;  # [m]
  unixTimestampMillis @7 :Int64;
  source @8 :UInt16;
  vNED @9 :List(Float32);  # [m/s]
  verticalAccuracy @10 :Float32;
  bearingAccuracyDeg @11 :Float32;
  speedAccuracy @12 :Float32;
  hasFix @13 :Bool;
}

struct CarState {
  other0 @0 :AnyPointer;
  vEgo @1 :Float32;
  other2 @2 :AnyPointer;
  gas @3 :Float32;
  other4 @4 :Bool;
  other5 @5 :Float32;
  brakePressed @6 :Bool;
  other7 @7 :Float32;
  other8 @8 :Float32;
  other9 @9 :Bool;
  other10 @10 :AnyPointer;
  other11 @11 :AnyPointer;
  other12 @12 :AnyPointer;
  other13 @13 :AnyPointer;
  other14 @14 :UInt16;
  other15 @15 :Float32;
  other16 @16 :Float32;
  vEgoRaw @17 :Float32;
  other18 @18 :Bool;
  other19 @19 :Bool;
  other20 @20 :Bool;
  other21 @21 :Bool;
  other22 @22 :Float32;
  other23 @23 :Bool;
  other24 @24 :Bool;
  other25 @25 :Bool;
  other26 @26 :Bool;
  other27 @27 :Float32;
  clutchPressed @28 :Bool;
  other29 @29 :Bool;
  other30 @30 :Bool;
  other31 @31 :Bool;
  other32 @32 :Bool;
  other33 @33 :Bool;
  other34 @34 :Bool;
  other35 @35 :Bool;
  other36 @36 :Bool;
  other37 @37 :Float32;
  other38 @38 :Bool;
  other39 @39 :Bool;
  other40 @40 :Bool;
  other41 @41 :Float32;
  other42 @42 :Bool;
  other43 @43 :Bool;
  other44 @44 :Float32;
  other45 @45 :Bool;
  engineRpm @46 :Float32;
}
