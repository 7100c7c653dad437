/* The part of NI-SCOPE's C interface that the driver reaches through NI's Python package; a card of 8 channels whose
 * counts are a ramp, channel n shifted by 1000 n.  What it was told is appended to the file named by NISCOPE_LOG. */
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef int32_t status;
typedef uint32_t session;
#pragma pack(push, 8)
struct info { double absolute_x, relative_x, step; int32_t samples; double offset, gain, reserved1, reserved2; };
#pragma pack(pop)

static double rate = 1e7, reference = 0;
static int32_t points = 1000, polls = 0;

static void tell(const char *format, const char *text, double a, double b, double c) {
    FILE *log = fopen(getenv("NISCOPE_LOG"), "a");
    if (log) { fprintf(log, format, text, a, b, c); fputc('\n', log); fclose(log); }
}
static int waveforms(const char *channels) {
    int n = 1;
    for (; *channels; channels++) n += *channels == ',';
    return n;
}

status niScope_InitWithOptions(const char *name, uint16_t q, uint16_t r, const char *o, session *s) {
    *s = 7;
    return strcmp(name, "Dev1") ? -1074118656 : 0;
}
status niScope_GetError(session s, status *code, int32_t size, char *text) {
    static const char message[] = "Device identifier is invalid.\nDevice: Dev9";
    if (!size) return sizeof message;
    *code = -1074118656;
    strncpy(text, message, size);
    return 0;
}
status niScope_GetChannelNameFromString(session s, const char *indices, int32_t size, char *names) {
    static const char all[] = "0,1,2,3,4,5,6,7";
    if (!size) return sizeof all;
    strncpy(names, all, size);
    return 0;
}
status niScope_GetAttributeViInt32(session s, const char *c, int32_t a, int32_t *v) { *v = a == 1050203 ? 8 : 0; return 0; }
status niScope_SetAttributeViInt32(session s, const char *c, int32_t a, int32_t v) { return 0; }
status niScope_GetAttributeViReal64(session s, const char *c, int32_t a, double *v) { *v = a == 1250010 ? rate : 0; return 0; }
status niScope_LockSession(session s, uint16_t *h) { return 0; }
status niScope_UnlockSession(session s, uint16_t *h) { return 0; }
status niScope_ConfigureVertical(session s, const char *c, double range, double offset, int32_t coupling, double probe, uint16_t on) {
    tell("vertical %s %g V, coupling %g, on %g", c, range, coupling, on);
    return 0;
}
status niScope_ConfigureHorizontalTiming(session s, double r, int32_t n, double ref, int32_t records, uint16_t real) {
    tell("timing%s %g Hz, %g points, reference %g", "", r, n, ref);
    rate = r > 60e6 ? 60e6 : r; points = n; reference = ref;
    return 0;
}
status niScope_ConfigureTriggerEdge(session s, const char *c, double level, int32_t slope, int32_t coupling, double h, double d) {
    tell("edge %s %g V, slope %g, coupling %g", c, level, slope, coupling);
    return 0;
}
status niScope_ConfigureTriggerDigital(session s, const char *c, int32_t slope, double h, double d) {
    tell("digital %s slope %g, %g %g", c, slope, h, d);
    return 0;
}
status niScope_InitiateAcquisition(session s) { polls = 0; return 0; }
status niScope_AcquisitionStatus(session s, int32_t *v) { *v = !getenv("NISCOPE_NEVER") && polls++ > 2; return 0; }
status niScope_ActualNumWfms(session s, const char *c, int32_t *n) { *n = waveforms(c); return 0; }
status niScope_FetchBinary16(session s, const char *c, double timeout, int32_t n, int16_t *out, struct info *infos) {
    for (int w = 0; w < waveforms(c); w++) {
        int channel = atoi(c + 2 * w);
        for (int32_t i = 0; i < n; i++) out[(size_t)w * n + i] = (int16_t)(i % 30000 + 1000 * channel);
        infos[w] = (struct info){0, -(double)(int32_t)(points * reference / 100 + 0.5) / rate, 1 / rate, n, 0.5 * channel, 1e-4, 0, 0};
    }
    return 0;
}
status niScope_Abort(session s) { tell("abort%s", "", 0, 0, 0); return 0; }
status niScope_close(session s) { tell("close%s", "", 0, 0, 0); return 0; }
