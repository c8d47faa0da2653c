// SPDX-License-Identifier: GPL-3.0-or-later
// Work on pairs of faces: those of an axis on one side of a cell.

layout(std430, binding = BUF_WORK) readonly buffer FaceWork { uint face_work[]; };  // cell | side << 29 | axis << 30

void fetch_face_work(uint number, out uint cell, out uint side, out uint axis)
{
    uint word = face_work[number];
    cell = word & 0x1FFFFFFFu;
    side = word >> 29 & 1u;
    axis = word >> 30;
}
