// Sends an MPU-6050 as JSON lines, 100 a second; see docs/live.md, "Line protocol".
#include <Wire.h>
#include <esp_timer.h>

const int SENSOR = 0x68;
uint32_t due;

void put(int reg, int value) {
  Wire.beginTransmission(SENSOR);
  Wire.write(reg);
  Wire.write(value);
  Wire.endTransmission();
}

int16_t word16() {
  int high = Wire.read();
  return (int16_t)((high << 8) | Wire.read());
}

void setup() {
  Serial.begin(460800);
  Wire.begin();
  Wire.setClock(400000);
  put(0x6B, 1);     // awake, by the clock of a gyro
  put(0x1A, 3);     // low-pass filter of 44 Hz
  put(0x1B, 0x08);  // gyro to 500 deg/s
  put(0x1C, 0x08);  // accelerometer to 4 g
  due = micros();
}

void loop() {
  if ((int32_t)(micros() - due) < 0) return;
  due += 10000;     // 100 a second
  Wire.beginTransmission(SENSOR);
  Wire.write(0x3B);
  Wire.endTransmission(false);
  if (Wire.requestFrom(SENSOR, 14) != 14) return;
  double t = esp_timer_get_time() * 1e-6;
  float v[7];
  for (int k = 0; k < 7; k++) v[k] = word16();
  const float A = 9.80665f / 8192.0f, G = 0.01745329f / 65.5f;
  Serial.printf("{\"t\": %.6f, \"accel\": [%.4f, %.4f, %.4f], \"gyro\": [%.5f, %.5f, %.5f]}\n",
                t, v[0] * A, v[1] * A, v[2] * A, v[4] * G, v[5] * G, v[6] * G);
}
