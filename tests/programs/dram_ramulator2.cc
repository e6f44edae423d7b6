// Feeds a trace of splatsim to Ramulator 2.1: in its order, each request when it is due and there is room. Built by dram.py.
#include <ramulator/base/config.h>
#include <ramulator/base/factory.h>
#include <ramulator/base/request.h>
#include <ramulator/frontend/i_frontend.h>
#include <ramulator/memory_system/i_memory_system.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <unordered_map>

int main(int argc, char** argv) {
  if (argc != 7) {
    fprintf(stderr, "usage: %s CONFIG BURST_BYTES TRACE NS_OF_A_TRACE_CYCLE(0: as fast as there is room) TCK_NS CHANNELS\n", argv[0]);
    return 2;
  }
  auto config = Ramulator::Config::parse_config_file(argv[1]);
  auto* frontend = Ramulator::Factory::create_frontend(config);
  auto* memory = Ramulator::Factory::create_memory_system(config);
  frontend->connect_memory_system(memory);
  memory->connect_frontend(frontend);
  const int burst = atoi(argv[2]), step = memory->get_tx_bytes();
  const double of_trace = atof(argv[4]), tck = atof(argv[5]);
  const uint64_t next_column = burst * strtoull(argv[6], nullptr, 10);
  uint64_t clock = 0, last = 0, pending = 0;
  std::unordered_map<uint64_t, int> under_way;
  FILE* trace = fopen(argv[3], "r");
  if (!trace) return 2;
  unsigned long long address, due;
  char kind[8];
  auto read = [&] { return fscanf(trace, "%llx %7s %llu", &address, kind, &due) == 3; };
  // A burst of the model is one or more of the device.
  int part = 0;
  for (bool is_left = read(); is_left || pending; clock++) {
    while (is_left && clock * tck >= due * of_trace) {
      // Two writes to one address are one here, and a read is answered by a write that waits; the model moves both.
      uint64_t at = address + part;
      for (uint64_t bit = next_column; under_way.count(at); bit *= 2) at = (address + part) ^ bit;
      const int type = kind[0] == 'W' ? Ramulator::Request::Type::Write : Ramulator::Request::Type::Read;
      auto done = [&, at](Ramulator::Request&) { pending--, last = clock, under_way.erase(at); };
      if (!frontend->receive_external_requests(type, at, 0, done, step)) break;
      under_way[at] = 1, pending++;
      part = (part + step) % burst;
      if (part == 0) is_left = read();
    }
    memory->tick();
  }
  printf("%.0f\n", last * tck);
  frontend->finalize();
  memory->finalize();
}
