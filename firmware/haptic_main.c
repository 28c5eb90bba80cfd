/* SPDX-License-Identifier: Apache-2.0
 *
 * The device's loop; it reaches hardware by haptic_board.h alone.
 */
#include "haptic_board.h"
#include "haptic_core.h"

void haptic_step(struct haptic *device) {
    uint8_t bytes[256];
    int count = board_read(bytes, sizeof bytes);
    int64_t now = board_now_ns();
    if (count > 0) {
        haptic_receive(device, bytes, count, now);
        return;
    }
    haptic_advance(device, now);
    board_wait_until(haptic_due(device, now));
}
