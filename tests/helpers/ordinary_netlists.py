"""Ordinary netlists as one finds them, correct all; each with the sources of a co-simulation."""

HEAD = "Vcommand v1 0 SIN(0 1 50)\nRcoil v1 c1 7.1\nVemf c1 0 0\n"
TAIL = ".tran 10u 2m\n.end\n"

BODIES = {
    "BJT audio amplifier": """
* class AB, bootstrapped
Vcc vcc 0 DC 12
Vee vee 0 -12
Cin v1 b1 1u
R1 b1 0 47k ; bias
Q1 c1a b1 e1 QN
Q2 vcc fb e1 QN
Re e1 vee 4.7k
Rc vcc c1a 1.2k
Q3 c3 c1a vcc QP
Dq1 c3 d1 D1N4148
Dq2 d1 c4 D1N4148
Rb c4 vee 2.2k
Q4 vcc c3 o1 QN 2
Q5 vee c4 o2 QP area=2
Ro1 o1 out .22
Ro2 out o2 0.22
Rf out fb 22k
Rg fb fbc 1k
Cg fbc 0 100uF IC=0
Rload out 0 8Ohm
.model QN NPN(IS=1e-14 BF=200 VAF=100
+ CJE=10p CJC=5p
* a comment amid a model
+ TF=0.3n)
.model QP PNP (is=1e-14, bf=150, vaf=80)
.model D1N4148 D (IS=2.52n RS=.568 N=1.752 CJO=4P M=.4 TT=20n)
""",
    "H-bridge": """
.param vbus=24 fpwm=20k duty={0.6} tper='1/fpwm'
Vbus bus 0 {vbus}
Bpwm pwm 0 V = (time*fpwm - floor(time*fpwm)) < duty ? 5 : 0
Bnot pwmn 0 V=5-V(pwm)
S1 bus a pwm 0 SWM OFF
S2 a 0 pwmn 0 SWM
S3 bus b pwmn 0 SWM
S4 b 0 pwm 0 SWM on
D1 0 a DF
D2 a bus DF
D3 0 b DF
D4 b bus DF
Lm a m 1m
Rm m b 1
.model SWM SW(Vt=2.5 Vh=0.1 Ron=10m Roff=1Meg)
.model DF D(is=1n rs=5m)
.options reltol=1e-4 method=gear acct
""",
    "MOSFET": """
.global vdd
VDD vdd 0 12
M1 d g 0 0 NM W=100u L={2u}
Rg v1 g 100
Rd vdd d 1k
M2 out v1 0 pw
Rl vdd out 100
XI v1 inv inverter w='10u' PARAMS: l=2u
Rinv inv 0 1Meg
.subckt inverter in out w=1u l=1u
Mn out in 0 0 NM w={w} l={l}
Mp out in vdd vdd PM w={2*w} l={l}
.ends
.model NM NMOS (LEVEL=1 VTO=1 KP=50u LAMBDA=0.01)
.MODEL PM pmos(Level = 3 VTO = -1 KP = 20u)
.model pw VDMOS(Rg=3 Vto=4 Rd=1m Rs=1m Rb=1m Kp=10 Cgdmax=1n Cgdmin=.1n Cgs=1n Cjo=1n Is=1p)
""",
    "op-amp macromodels": """
* inverting, then integrating with feedback round it
Xa 0 m1 o1 OPAMP gbw=3Meg
R1 v1 m1 10k
R2 m1 o1 22k
Xb o1 m2 o2 vp vn UA741
R3 m2 0 1k
R4 m2 o2 9k
Vp vp 0 15
Vn 0 vn 15
Gint 0 int o2 int 1m
Cint int 0 1u
.subckt OPAMP inp inn out params: a0=100k gbw=1meg
Rin inp inn 1e12
G1 0 p inp inn {a0/1e6}
Rp p 0 1e6
Cp p 0 {a0/(2*3.14159*gbw*1e6)}
E1 o 0 p 0 1
Rout o out 50
.ends OPAMP
.subckt UA741 1 2 3
+ 4 5
* input impedance
Rid 1 2 2Meg
Ga 0 6 1 2 1m
Ra 6 0 100Meg
Ca 6 0 159p
Bout 7 0 V = max(min(V(6), V(4)-1.5), V(5)+1.5)
Ro 7 3 75
.ends
""",
    "transformer and rectifier": """
Vac p 0 SIN(0 325 50)
Rp p p1 1
L1 p1 0 10
L2 s1 0 0.1
L3 s2 0 100m
K1 L1 L2 0.999
K2 L1 L3 0.999
K3 L2 L3 {0.999}
D1 s1 dc dd
D2 s2 dc dd
C1 dc 0 1000u ic=0
R1 dc 0 100
.model dd d
""",
    "lines and switches": """
Rs v1 ta 50
T1 ta 0 tb 0 Z0=50 TD=10u
Rt tb 0 50
T2 ta 0 tc 0 Z0=75 F=10k NL=0.25
W1 tc wb Vsb WM
Vsb tb sb
Rsb sb 0 1k
Rw wb 0 50
O1 ta 0 to 0 LM
Ro to 0 50
.model LM LTRA(REL=1 LININTERP R=0 L=250u C=100n LEN=2)
.model WM CSW(IT=1m IH=0.1m RON=1 ROFF=1G)
""",
    "functions and conditions": """
.param mode = 2 , gain=3 k={gain*2}
.func lim(x,lo,hi) {max(lo, min(hi, x))}
.func sq(x) 'x*x'
.func cube (x) = x*sq(x)
.param h(x)='sq(x)+k'
.if (mode == 1)
Rx v1 x 1k
.model DX D(is=1e-14)
.elseif (mode==2 && gain>1)
Rx v1 x {h(3)*1k}
.model DX D(is={k*1e-15})
.else
Rx v1 x 3k
.model DX D
.endif
Dx x 0 DX
Bl l 0 V=lim(V(x), -0.2, {gain/10}) + 0*i(Vemf)
Rl l 0 1k
Xq l q stage r={k*1k} m=1
Rq q 0 1k
.subckt stage in out r=1k
.param half='r/2'
.if (r > 2k)
Ra in out {half}
.else
Ra in out {r}
.endif
Xin in out inner
.ends stage
.subckt inner a b
Rcaller a b {r*10}
.ends
""",
    "controlled sources": """
E1 e1 0 v1 0 2
E2 e2 0 (v1,0) 2
E3 e3 0 VALUE={V(v1)*V(e1) + pi}
E4 e4 0 vol='V(v1,e1)*2'
E5 e5 0 TABLE {V(v1)} = (-1 -2) (0 0) (1, 2)
E6 e6 0 POLY(2) v1 0 e1 0 0 1 1 0.5
G1 0 g1 v1 0 1m
Rg1 g1 0 1k
G2 0 g2 cur='V(v1)/1k'
Rg2 g2 0 1k
F1 0 f1 Vemf 2
Rf1 f1 0 1k
F2 0 f2 POLY(1) Vemf 0 1
Rf2 f2 0 1k
H1 h1 0 Vemf 10
B1 b1 0 V = {2}*V(v1)**2 + (V(v1)>0.5 ? 1 : 0)
B2 0 b2 I=1m*tanh(V(v1))
Rb2 b2 0 R='1k*(1+abs(V(v1)))'
Cv v1 0 C='1u*(1+V(v1))'
Rm v1 0 rmod L=10u W=1u
.model rmod R(rsh=1k)
Vr r1 0 PULSE (0,1,0,1n,1n,1u,2u)
Vp r2 0 dc 1 ac 1 0 PWL(0 0 1m 1
+ 2m 0)
Vq r4 0 PWL(0 0 1m 1) ac 1 +90
Rr4 r4 0 1k
I1 0 r3 {1m}
Rr3 r3 0 1k tc1=1m tc2={1u}
""",
    "comments and odd names": """
$ dollar
// slashes
* stars ** with .control and µΩ inside
*************** ####### ***************
R1 v1 N$1 1k $ trailing
R2 N$1 /net-2 1k // trailing
R3 /net-2 a.b+ 1k ; trailing µ
  R4   a.b+\tGND 1k
+ tc1=0

* between
+ tc2=0
.ic v(N$1)=0
.nodeset V(a.b+)=0
.temp 27
.probe alli
.save all
.PRINT tran v(v1)
.meas tran top max v(v1)
.width out=80
""",
    "JFET and MESFET": """
Vdd vdd 0 10
J1 jd v1 js JN
Rj vdd jd 1k
Rjs js 0 100
Z1 zd v1 0 ZM
Rz vdd zd 1k
.model JN NJF(vto=-2 beta=1m)
.model ZM NMF(vto=-1.3)
.options itl1=200 gmin=1e-12, abstol=1p
""",
    "parts of a library that are not used": """
Rload v1 0 1k
.model DX D(IS=1n mfg=Somebody type=silicon)
.func f(x) {x*nope}
.subckt sensor a b vdd
M1 a b vdd foundry
Q1 a b {nope} 1 2 3
X1 a missing
.ends
""",
    "shunted floating nodes": """
C1 v1 mid 1u
C2 mid 0 1u
.options rshunt=1e12
""",
    "initial condition on a capacitor divider": """
C1 v1 mid 1u
C2 mid 0 1u
.ic v(mid)=0
""",
}
ORDINARY = {name: f"{name}\n{HEAD}{body.lstrip()}{TAIL}" for name, body in BODIES.items()}
