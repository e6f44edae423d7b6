// Handshakes: binds the assertions of handshake.sv to all internal ports of the RTL
// implementations. The results of each unit leave it through a pipe, so one line covers most ports.
// The others are the requests and outputs of fragment, sheets and windows, and the outputs of fill
// to shade and resolve.
//
// Macros
//   HAS_FRAGMENT   the RTL implementation contains fragment
//   HAS_SHEETS     it contains sheets
//   HAS_WINDOWS    it contains windows
//   HAS_LIGHTING   it contains shade
//   HAS_RESOLVE    it contains resolve
bind pipe handshake #(.W(W)) handshake_of_m (.clk(clk), .rst(rst), .valid(m_valid), .ready(m_ready), .data(m_data));
`ifdef HAS_FRAGMENT
bind fragment handshake #(.W(machine_pkg::FRAGMENT_IN_W)) handshake_of_s (.clk(clk), .rst(rst), .valid(s_valid), .ready(s_ready), .data(s_data));
bind fragment handshake #(.W(machine_pkg::FRAGMENT_REQUEST_W)) handshake_of_q (.clk(clk), .rst(rst), .valid(q_valid), .ready(q_ready), .data(q_data));
bind fragment handshake #(.W(machine_pkg::FRAGMENT_ANSWER_W)) handshake_of_a (.clk(clk), .rst(rst), .valid(a_valid), .ready(a_ready), .data(a_data));
// The other fields of an empty pixel have no meaning.
bind fragment handshake #(.W(machine_pkg::FRAGMENT_HELD_W + 2)) handshake_of_h (.clk(clk), .rst(rst), .valid(h_valid), .ready(h_ready), .data({h_last, h_empty, h_data & {machine_pkg::FRAGMENT_HELD_W{!h_empty}}}));
`endif
`ifdef HAS_SHEETS
bind sheets handshake #(.W(machine_pkg::FRAGMENT_IN_W)) handshake_of_s (.clk(clk), .rst(rst), .valid(s_valid), .ready(s_ready), .data(s_data));
bind sheets handshake #(.W(machine_pkg::FRAGMENT_HELD_W + 1)) handshake_of_h (.clk(clk), .rst(rst), .valid(h_valid), .ready(h_ready), .data({h_empty, h_data & {machine_pkg::FRAGMENT_HELD_W{!h_empty}}}));
`endif
`ifdef HAS_WINDOWS
bind windows handshake #(.W(machine_pkg::FRAGMENT_IN_W)) handshake_of_s (.clk(clk), .rst(rst), .valid(s_valid), .ready(s_ready), .data(s_data));
bind windows handshake #(.W(machine_pkg::FRAGMENT_REQUEST_W)) handshake_of_q (.clk(clk), .rst(rst), .valid(q_valid), .ready(q_ready), .data(q_data));
bind windows handshake #(.W(machine_pkg::FRAGMENT_ANSWER_W)) handshake_of_a (.clk(clk), .rst(rst), .valid(a_valid), .ready(a_ready), .data(a_data));
bind windows handshake #(.W(machine_pkg::FRAGMENT_HELD_W + 2)) handshake_of_h (.clk(clk), .rst(rst), .valid(h_valid), .ready(h_ready), .data({h_last, h_empty, h_data & {machine_pkg::FRAGMENT_HELD_W{!h_empty}}}));
`endif
`ifdef HAS_LIGHTING
bind shade handshake #(.W(TAG_W + machine_pkg::SHADE_IN_W)) handshake_of_s (.clk(clk), .rst(rst), .valid(s_valid), .ready(s_ready), .data(s_data));
`endif
`ifdef HAS_RESOLVE
bind resolve handshake #(.W(machine_pkg::RESOLVE_IN_W)) handshake_of_s (.clk(clk), .rst(rst), .valid(s_valid), .ready(s_ready), .data(s_data));
`endif
