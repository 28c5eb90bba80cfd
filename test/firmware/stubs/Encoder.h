/* SPDX-License-Identifier: Apache-2.0 */
struct Encoder {
    Encoder(int a, int b);
    int read();
};
