/* SPDX-License-Identifier: Apache-2.0
 *
 * As much of the Arduino cores of Teensy 4 and RP2040 as the sketches name, for a compiler to look at them.
 */
#include <math.h>
#include <stdint.h>
#include <string.h>

enum { LOW, HIGH, INPUT_PULLUP, OUTPUT, CHANGE };

struct Line {
    int available();
    int availableForWrite();
    int read();
    size_t write(const uint8_t *bytes, size_t count);
    void send_now();
    void flush();
};
extern Line Serial;
extern volatile uint32_t ARM_DWT_CYCCNT;
extern uint32_t F_CPU_ACTUAL;

void pinMode(int pin, int mode);
void digitalWrite(int pin, int value);
int digitalRead(int pin);
void analogWrite(int pin, int value);
void analogWriteResolution(int bits);
void analogWriteFrequency(int pin, float frequency);
void analogWriteFreq(uint32_t frequency);
float tempmonGetTemp();
float analogReadTemp();
uint64_t time_us_64();
int digitalPinToInterrupt(int pin);
void attachInterrupt(int pin, void (*handler)(), int mode);
