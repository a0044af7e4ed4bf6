/* A drive with the registers of the generic profile behind libmodbus, which shares nothing with us.
 *
 *     drive tcp            listens on 127.0.0.1, prints its port
 *     drive rtu DEVICE     serves a serial line at 115200 8N1
 *
 * When a master leaves, it prints control word, torque commanded, and requests answered; over TCP it
 * then waits for the next: a master that was held up drops a silent connection and comes back. */
#include <arpa/inet.h>
#include <errno.h>
#include <modbus.h>
#include <netinet/in.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

enum { IDENTITY = 0, STATUS = 2, POSITION = 4, TORQUE = 8, CONTROL = 16, TARGET = 18 };

static void prime(uint16_t *words)
{
    words[IDENTITY] = 0x5457;
    words[1] = 1;
    words[STATUS] = 1;
    words[33] = 1;    /* it would store in EEPROM */
    words[42] = 0;    /* 65536 counts a turn */
    words[41] = 1;
    words[44] = 1000; /* 1 N m */
}

static void follow(uint16_t *words, int *position)
{
    int on = words[CONTROL] & 1;
    words[STATUS] = on ? 3 : 1;
    words[TORQUE] = on ? words[TARGET] : 0;
    *position += (int16_t)words[TORQUE];
    words[POSITION] = (uint32_t)*position >> 16;
    words[POSITION + 1] = (uint32_t)*position & 0xFFFF;
}

static void serve(modbus_t *line, modbus_mapping_t *map)
{
    static int position, answered;
    uint8_t query[MODBUS_MAX_ADU_LENGTH];
    int size;
    for (;;) {
        size = modbus_receive(line, query);
        if (size == 0)
            continue; /* for another unit */
        if (size < 0) {
            if (errno == EMBBADCRC)
                continue;
            break;
        }
        follow(map->tab_registers, &position);
        if (modbus_reply(line, query, size, map) < 0)
            break;
        answered++;
    }
    printf("%u %d %d\n", map->tab_registers[CONTROL], (int16_t)map->tab_registers[TARGET], answered);
    fflush(stdout);
}

int main(int count, char **words)
{
    int tcp = count > 1 && strcmp(words[1], "tcp") == 0;
    modbus_t *line = tcp ? modbus_new_tcp("127.0.0.1", 0) : modbus_new_rtu(words[2], 115200, 'N', 8, 1);
    modbus_mapping_t *map = modbus_mapping_new(0, 0, 64, 0);
    if (line == NULL || map == NULL)
        return 1;
    prime(map->tab_registers);
    modbus_set_slave(line, 1);
    if (tcp) {
        struct sockaddr_in where;
        socklen_t size = sizeof where;
        int listener = modbus_tcp_listen(line, 1);
        if (listener < 0 || getsockname(listener, (struct sockaddr *)&where, &size) < 0)
            return 2;
        printf("%d\n", ntohs(where.sin_port));
        fflush(stdout);
        while (modbus_tcp_accept(line, &listener) >= 0) {
            serve(line, map);
            modbus_close(line);
        }
        return 3;
    } else {
        if (modbus_connect(line) < 0)
            return 4;
        printf("0\n");
        fflush(stdout);
        serve(line, map);
        modbus_close(line);
    }
    modbus_mapping_free(map);
    modbus_free(line);
    return 0;
}
